"""Bags of robots: the topics in them, messages as rows of tables, reading with and without ROS, repair."""
