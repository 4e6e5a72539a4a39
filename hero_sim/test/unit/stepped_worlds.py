"""Worlds for tests of stepped robots."""

import numpy as np

from hero_sim.world.arena import build_default, place_robots
from hero_sim.world.robot_errors import draw_errors
from hero_sim.world.world import World


def build_world(count, *seeds, scale=1.0):
    """Return one world of count robots for each seed."""
    arena = build_default(count)
    poses = np.vstack([place_robots(arena, count, np.random.RandomState(seed)) for seed in seeds])
    rngs = [np.random.RandomState([seed, index]) for seed in seeds for index in range(count)]
    return World(arena, poses, [np.random.RandomState(seed) for seed in seeds], draw_errors(rngs, scale))
