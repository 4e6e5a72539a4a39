"""From images to poses of robots, objects and reference tags in `map`."""
