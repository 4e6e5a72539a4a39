"""Robots that drive, each by itself or by its operator."""
