"""ROS: publishers, subscribers and services of robots, and every access to rospy."""
