"""A camera above simulated robots: the only room that needs hero_sim."""
