"""Metrics of swarms: pure functions on arrays, over W worlds with N robots each at once."""

from typing import Callable, Dict

import numpy as np

from hero_client.values import BODY_RADIUS_M

from .graphs import algebraic_connectivity, cluster_fraction, collisions, nearest_neighbor
from .motion import consensus_error, order, rotation
from .objects import object_cluster_fraction, object_distance
from .shapes import coverage, dispersion, dispersion_ratio, fatness, hull_area

__all__ = [
    "FALLING", "METRICS", "UNITS", "algebraic_connectivity", "cluster_fraction", "collisions", "consensus_error",
    "coverage", "dispersion",
    "dispersion_ratio", "fatness", "hull_area", "nearest_neighbor",
    "object_cluster_fraction", "object_distance", "order", "rotation", "time_until",
]  # fmt: skip

Metric = Callable[..., np.ndarray]
"""Function of poses and velocities (W, N, 3) in the common frame, of the poses of objects (W, M, 3), and of the bodies'
radii (N,); the last two may be left out where they do not count. Returns one number for each world (W,)."""

METRICS: Dict[str, Metric] = {
    "algebraic_connectivity": lambda poses, *_: algebraic_connectivity(poses[..., :2], 0.5),
    "cluster_fraction": lambda poses, *_: cluster_fraction(poses[..., :2]),
    "collisions": lambda poses, velocities, objects=None, radii_m=BODY_RADIUS_M: (collisions(poses[..., :2], radii_m)),
    "consensus_error": lambda poses, *_: consensus_error(poses[..., :2]),
    "dispersion": lambda poses, *_: dispersion(poses[..., :2]),
    "dispersion_ratio": lambda poses, *_: dispersion_ratio(poses[..., :2]),
    "fatness": lambda poses, *_: fatness(poses[..., :2]),
    "hull_area": lambda poses, *_: hull_area(poses[..., :2]),
    "nearest_neighbor": lambda poses, *_: nearest_neighbor(poses[..., :2]),
    "object_cluster_fraction": lambda poses, velocities, objects, *_: object_cluster_fraction(objects[..., :2]),
    "object_distance": lambda poses, velocities, objects, *_: object_distance(objects[..., :2]),
    "order": lambda poses, *_: order(poses[..., 2]),
    "rotation": lambda poses, velocities, *_: rotation(poses[..., :2], velocities[..., :2]),
}
"""Those that need poses and velocities alone, by name."""

UNITS = {"consensus_error": "m", "dispersion": "m", "hull_area": "m^2", "nearest_neighbor": "m", "object_distance": "m"}
"""Units of those that have one."""

FALLING = ("collisions", "consensus_error", "dispersion", "dispersion_ratio", "fatness", "hull_area", "object_distance")
"""Metrics for which less is better: a bound without <= or >= is an upper one; it is a lower one for all others."""


def time_until(times_s: np.ndarray, values: np.ndarray, limit: float, falls: bool = True) -> np.ndarray:
    """Return when values (T, W) first reach limit from above, or from below (W,); inf if they never do."""
    reached = values <= limit if falls else values >= limit
    return np.where(reached.any(axis=0), times_s[reached.argmax(axis=0)], np.inf)
