"""Points of the program check: one module per area, each point a function that returns a finding."""
