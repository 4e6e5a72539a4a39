"""Metrics of how robots move together. Pure: arrays over worlds and robots; results (W,)."""

from typing import Optional

import numpy as np

from hero_client.values import BODY_RADIUS_M
from hero_sim.world import Arena, measure_clearance

MIN_SPEED_M_S = 0.01
"""A robot that is slower does not move: one that is stuck creeps."""

_NEAR_WALL_M = 4.0 * BODY_RADIUS_M
_MAX_TOWARDS = 0.5


def order(headings_rad: np.ndarray, velocities_m_s: Optional[np.ndarray] = None) -> np.ndarray:
    """Return the length of the mean heading (W, N): 1 if all robots head the same way, near 0 if each its own.

    With velocities (W, N, 2) robots that do not move count as 0.
    """
    counts = 1.0 if velocities_m_s is None else np.hypot(*np.moveaxis(velocities_m_s, -1, 0)) > MIN_SPEED_M_S
    return np.hypot((counts * np.cos(headings_rad)).mean(axis=1), (counts * np.sin(headings_rad)).mean(axis=1))


def rotation(places_m: np.ndarray, velocities_m_s: np.ndarray) -> np.ndarray:
    """Return the normalized angular momentum about the center of all robots, from 0 to 1.

    1 if all circle it in the same direction; robots that do not move count as 0. Both arguments (W, N, 2).
    """
    arms_m = places_m - places_m.mean(axis=1, keepdims=True)
    momenta = arms_m[..., 0] * velocities_m_s[..., 1] - arms_m[..., 1] * velocities_m_s[..., 0]
    speeds_m_s = np.hypot(velocities_m_s[..., 0], velocities_m_s[..., 1])
    lengths = np.hypot(arms_m[..., 0], arms_m[..., 1]) * speeds_m_s
    shares = np.where(speeds_m_s > MIN_SPEED_M_S, momenta / np.maximum(lengths, 1e-12), 0.0)
    return np.abs(shares.mean(axis=1))


def wall_following(places_m: np.ndarray, velocities_m_s: np.ndarray, arena: Optional[Arena]) -> np.ndarray:
    """Return the share of robots that move along a wall or obstacle, at most a diameter off; nan without an arena."""
    if arena is None:
        return np.full(len(places_m), np.nan)
    step_s = 0.01
    points_m, speeds_m_s = places_m.reshape(-1, 2), np.hypot(velocities_m_s[..., 0], velocities_m_s[..., 1])
    gaps_m = measure_clearance(points_m, arena)
    away_m_s = (measure_clearance(points_m + step_s * velocities_m_s.reshape(-1, 2), arena) - gaps_m) / step_s
    is_along = (gaps_m < _NEAR_WALL_M) & (np.abs(away_m_s) < _MAX_TOWARDS * speeds_m_s.ravel())
    shares = (is_along.reshape(speeds_m_s.shape) & (speeds_m_s > MIN_SPEED_M_S)).mean(axis=1)
    return np.where(np.isnan(places_m).any(axis=(1, 2)), np.nan, shares)


def consensus_error(values: np.ndarray) -> np.ndarray:
    """Return the root mean square distance of values (W, N, K) from their mean in each world."""
    off = values - values.mean(axis=1, keepdims=True)
    error: np.ndarray = np.sqrt((off * off).sum(axis=2).mean(axis=1))
    return error
