"""Readers of one bag, behind the same interface: by ROS's rosbag, or without ROS by the package rosbags."""
