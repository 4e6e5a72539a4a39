"""Corrections of a robot's messages: odometry, stamps, transforms, ranges. Pure."""
