"""What the programs of this package and of hero_examples are made of."""
