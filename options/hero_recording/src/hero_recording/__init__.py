"""Records robots into bags, plots recordings, and exports them to CSV."""
