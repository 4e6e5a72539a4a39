"""A simulated camera above the arena: pictures, or corners of tags, by the robots' true poses. Needs OpenCV."""
