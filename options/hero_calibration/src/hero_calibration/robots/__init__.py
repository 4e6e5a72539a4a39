"""Robots under calibration: what is received of them, their commands, and all of them together."""
