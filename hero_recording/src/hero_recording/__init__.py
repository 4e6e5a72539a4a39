"""Robots on topics -> bags, and bags -> plots and tables."""
