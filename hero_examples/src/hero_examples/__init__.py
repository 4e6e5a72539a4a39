"""Example programs for HeRo robots."""
