"""Robots and drivers over ROS topics and services."""
