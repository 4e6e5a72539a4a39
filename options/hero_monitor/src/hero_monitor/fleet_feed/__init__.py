"""ROS topics into the state that pages show."""
