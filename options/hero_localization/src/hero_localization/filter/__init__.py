"""Turns odometry and measured poses into the poses of all robots in one frame."""
