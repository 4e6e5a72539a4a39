"""Models of a robot from its readings: dead zones, step responses, infrared constants. Pure."""
