"""Reports on the robots and the driver itself, and the lines that robots log."""
