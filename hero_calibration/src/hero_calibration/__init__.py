"""Measurements on robots that stand before us -> parameters in their flash, and files that bring them back."""
