"""Turns images into poses of robots, objects and reference tags in `map`."""
