"""What readings tell of a robot: dead zones, step responses, infrared constants. Pure."""
