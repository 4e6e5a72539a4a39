"""What a robot's messages need before ROS programs can use them: odometry, stamps, transforms, ranges. Pure."""
