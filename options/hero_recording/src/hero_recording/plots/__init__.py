"""Figures: what a recording tells of each robot as arrays, what follows from it, drawings."""
