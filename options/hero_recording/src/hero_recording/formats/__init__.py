"""The files that export writes: tables per robot, or a ROS 2 bag."""
