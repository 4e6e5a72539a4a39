"""The robot's model: its dimensions, and the URDF made of them."""
