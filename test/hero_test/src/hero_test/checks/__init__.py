"""What several test files check in the same way. Knows no ROS."""
