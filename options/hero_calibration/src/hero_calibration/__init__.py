"""Calibrates robots, all at once: writes parameters to their flash, and keeps them in files for restoring."""
