"""What the program check looks at: one module per area, each point a function that returns findings."""
