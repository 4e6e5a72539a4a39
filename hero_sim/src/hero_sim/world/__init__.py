"""The arena and the bodies in it: wheels, poses, collisions and infrared light, in steps of simulated time."""
