"""PlacedObjects that robots can push: their shapes, where these touch, and how they move. Pure."""
