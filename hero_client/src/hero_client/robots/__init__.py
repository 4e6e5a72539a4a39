"""Robots and swarms, whatever connects them. Pure."""
