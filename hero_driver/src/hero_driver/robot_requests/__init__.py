"""What robots ask of ROS: parameters and services, served on worker threads."""
