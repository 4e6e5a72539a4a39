"""Poses of the robots of a swarm in one common frame, and their map."""
