"""RViz for a swarm of HeRo robots."""
