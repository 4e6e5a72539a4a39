"""Cameras: where their pixels look, and the images that they deliver."""
