"""Programs that start and watch a swarm of HeRo robots."""
