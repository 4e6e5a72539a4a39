"""Fits the simulator to robots: from recordings to the differences of each robot."""
