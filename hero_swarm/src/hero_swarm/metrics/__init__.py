"""How well a swarm does: pure functions on arrays, over W worlds with N robots each at once."""

from typing import Callable, Dict

import numpy as np

from .graphs import algebraic_connectivity, cluster_fraction, collisions, nearest_neighbor
from .motion import consensus_error, order, rotation
from .shapes import coverage, dispersion, dispersion_ratio, fatness, hull_area

__all__ = [
    "METRICS", "UNITS", "algebraic_connectivity", "cluster_fraction", "collisions", "consensus_error",
    "coverage", "dispersion",
    "dispersion_ratio", "fatness", "hull_area", "nearest_neighbor", "order", "rotation", "time_until",
]  # fmt: skip

Metric = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Of poses and of velocities (W, N, 3), both in the common frame; returns one number for each world (W,)."""

METRICS: Dict[str, Metric] = {
    "algebraic_connectivity": lambda poses, velocities: algebraic_connectivity(poses[..., :2], 0.5),
    "cluster_fraction": lambda poses, velocities: cluster_fraction(poses[..., :2]),
    "collisions": lambda poses, velocities: collisions(poses[..., :2]).astype(float),
    "consensus_error": lambda poses, velocities: consensus_error(poses[..., :2]),
    "dispersion": lambda poses, velocities: dispersion(poses[..., :2]),
    "dispersion_ratio": lambda poses, velocities: dispersion_ratio(poses[..., :2]),
    "fatness": lambda poses, velocities: fatness(poses[..., :2]),
    "hull_area": lambda poses, velocities: hull_area(poses[..., :2]),
    "nearest_neighbor": lambda poses, velocities: nearest_neighbor(poses[..., :2]),
    "order": lambda poses, velocities: order(poses[..., 2]),
    "rotation": lambda poses, velocities: rotation(poses[..., :2], velocities[..., :2]),
}
"""Those that need poses and velocities alone, by name."""

UNITS = {"consensus_error": "m", "dispersion": "m", "hull_area": "m^2", "nearest_neighbor": "m"}
"""Of those that have one."""


def time_until(times_s: np.ndarray, values: np.ndarray, limit: float, falls: bool = True) -> np.ndarray:
    """Return when values (T, W) first reach limit from above, or from below (W,); inf if they never do."""
    reached = values <= limit if falls else values >= limit
    return np.where(reached.any(axis=0), times_s[reached.argmax(axis=0)], np.inf)
