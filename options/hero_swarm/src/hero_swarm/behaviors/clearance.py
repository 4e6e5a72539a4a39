"""Velocities away from other robots, and from whatever infrared sensors see. Pure: arrays over robots (R,)."""

import numpy as np

from hero_client.values import Neighborhood


def keep_apart(near: Neighborhood, distance_m: float, gain_1_s: float) -> np.ndarray:
    """Return velocities (2, R), forward and left, away from neighbors whose centers are nearer than distance_m."""
    range_m = np.maximum(near.range_m, 1e-6)
    push_1_s = gain_1_s * np.maximum(distance_m - range_m, 0.0) * near.seen / range_m
    return -np.array(((push_1_s * near.forward_m).sum(axis=1), (push_1_s * near.left_m).sum(axis=1)))


def keep_clear(ranges_m: np.ndarray, distance_m: float, gain_1_s: float) -> np.ndarray:
    """Return velocities (2, R), forward and left, away from what infrared sensors see nearer than distance_m.

    ranges_m: of each robot (R, 8), front first, counter-clockwise, from its center; nan where it is not known.
    """
    push_m_s = gain_1_s * np.fmax(distance_m - ranges_m, 0.0)
    angles_rad = np.arange(ranges_m.shape[1]) * (2.0 * np.pi / ranges_m.shape[1])
    return -np.array([(push_m_s * part).sum(axis=1) for part in (np.cos(angles_rad), np.sin(angles_rad))])
