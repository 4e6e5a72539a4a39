"""From odometry and measured poses to the poses of all robots in one frame."""
