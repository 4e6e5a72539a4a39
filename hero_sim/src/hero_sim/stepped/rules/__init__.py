"""Rules of firmware and driver as arrays over robots, one module for each part of a robot. Pure."""
