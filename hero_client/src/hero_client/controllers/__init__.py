"""Controllers: pure functions and classes that turn poses and ranges into velocities. They know no ROS."""
