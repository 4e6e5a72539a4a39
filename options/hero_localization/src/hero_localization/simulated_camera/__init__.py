"""A camera above simulated robots: the only room, besides stepped robots, that needs hero_sim."""
