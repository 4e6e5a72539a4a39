"""Parts of the programs of this package and of hero_examples."""
