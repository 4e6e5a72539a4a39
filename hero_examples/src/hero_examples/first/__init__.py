"""First scripts, of at most 25 lines each."""
