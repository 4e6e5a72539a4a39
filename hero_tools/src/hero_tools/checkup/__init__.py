"""What the program check inspects: one module per area, each point a function that returns a finding."""
