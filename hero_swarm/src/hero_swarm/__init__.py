"""Behaviors of swarms as array functions, the metrics that judge them, and the programs that run them."""
