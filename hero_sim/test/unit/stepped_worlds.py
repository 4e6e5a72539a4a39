"""Worlds for tests of stepped robots."""

import numpy as np

from hero_sim.robot.models import HERO, build_body
from hero_sim.world.arena import build_default, place_robots
from hero_sim.world.robot_errors import draw_errors
from hero_sim.world.world import World


def build_world(count, *seeds, scale=1.0, models=()):
    """Return one world of count robots for each seed; models: of the robots of one world."""
    arena = build_default(count)
    poses = np.vstack([place_robots(arena, count, np.random.RandomState(seed)) for seed in seeds])
    rngs = [np.random.RandomState([seed, index]) for seed in seeds for index in range(count)]
    errors = draw_errors(rngs, scale)
    for row in range(len(rngs)):
        build_body(models[row % count] if models else HERO, errors, row)
    return World(arena, poses, [np.random.RandomState(seed) for seed in seeds], errors)
