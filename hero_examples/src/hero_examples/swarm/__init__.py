"""Swarms: robots that know of each other."""
