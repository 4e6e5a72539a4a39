"""The occupancy grid that the robots' proximity sensors draw together."""
