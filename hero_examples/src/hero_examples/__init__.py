"""Building blocks of programs for HeRo robots."""
