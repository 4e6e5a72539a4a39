"""The emergency stop: delivered until robots rest, offered in ROS, kept over restarts of the driver."""
