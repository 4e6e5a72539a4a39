"""The programs that join the rooms to ROS."""
