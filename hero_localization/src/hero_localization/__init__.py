"""Where the robots of a swarm are, in one common frame, and what they map there."""
