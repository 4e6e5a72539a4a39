"""Metrics of swarms: pure functions on arrays, over W worlds with N robots each at once."""

from typing import Callable, Dict

import numpy as np

from hero_client.values import BODY_RADIUS_M

from .graphs import algebraic_connectivity, cluster_fraction, collisions, nearest_neighbor
from .motion import consensus_error, order, rotation, wall_following
from .shapes import dispersion, dispersion_ratio, fatness, object_cluster_fraction, object_distance

Metric = Callable[..., np.ndarray]
"""Function of poses and velocities (W, N, 3) in the common frame, of the poses of objects (W, M, 3), of the bodies'
radii (N,), and of the arena; the last three may be left out where they do not count. Returns numbers (W,)."""

METRICS: Dict[str, Metric] = {
    "algebraic_connectivity": lambda poses, *_: algebraic_connectivity(poses[..., :2], 0.5),
    "cluster_fraction": lambda poses, *_: cluster_fraction(poses[..., :2]),
    "collisions": lambda poses, _, objects=None, radii_m=BODY_RADIUS_M, *rest: collisions(poses[..., :2], radii_m),
    "consensus_error": lambda poses, *_: consensus_error(poses[..., :2]),
    "dispersion": lambda poses, *_: dispersion(poses[..., :2]),
    "dispersion_ratio": lambda poses, *_: dispersion_ratio(poses[..., :2]),
    "fatness": lambda poses, *_: fatness(poses[..., :2]),
    "nearest_neighbor": lambda poses, *_: nearest_neighbor(poses[..., :2]),
    "object_cluster_fraction": lambda poses, _, objects, *rest: object_cluster_fraction(objects[..., :2]),
    "object_distance": lambda poses, _, objects, *rest: object_distance(objects[..., :2]),
    "order": lambda poses, velocities, *_: order(poses[..., 2], velocities[..., :2]),
    "rotation": lambda poses, velocities, *_: rotation(poses[..., :2], velocities[..., :2]),
    "wall_following": lambda poses, velocities, objects=None, radii_m=None, arena=None: (
        wall_following(poses[..., :2], velocities[..., :2], arena)
    ),
}
"""Those that need no more than that, by name."""

UNITS = {"consensus_error": "m", "dispersion": "m", "nearest_neighbor": "m", "object_distance": "m"}
"""Units of those that have one."""

FALLING = ("collisions", "consensus_error", "dispersion", "dispersion_ratio", "fatness", "object_distance")
"""Metrics for which less is better: a bound without <= or >= is an upper one; it is a lower one for all others."""

CHANCE = {"rotation": 0.78, "wall_following": 0.3, "order": 0.39, "cluster_fraction": 0.95}
"""Metrics that one in twenty random controllers reaches: wheel_genome with 100 random numbers each, 9 and 20 robots in
1.71 m x 1.42 m, friction as drawn, last 30 of 120 s; the higher one (drawn once, script/bench swarm --only chance)."""


def score(name: str, values: np.ndarray) -> np.ndarray:
    """Return how far values of a metric in CHANCE are from chance, 0, to the best, 1; 0.5 and more names a behavior."""
    return np.clip((values - CHANCE[name]) / (1.0 - CHANCE[name]), 0.0, 1.0)
