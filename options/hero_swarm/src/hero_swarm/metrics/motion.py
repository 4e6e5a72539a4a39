"""Metrics of how robots move together. Pure: arrays over worlds and robots; results (W,)."""

import numpy as np

_STILL_M_S = 1e-3


def order(headings_rad: np.ndarray) -> np.ndarray:
    """Return the length of the mean heading (W, N): 1 if all robots head the same way, near 0 if each its own."""
    return np.hypot(np.cos(headings_rad).mean(axis=1), np.sin(headings_rad).mean(axis=1))


def rotation(places_m: np.ndarray, velocities_m_s: np.ndarray) -> np.ndarray:
    """Return the normalized angular momentum about the center of all robots, from 0 to 1.

    1 if all circle it in the same direction; robots slower than 1 mm/s count as 0. Both arguments (W, N, 2).
    """
    arms_m = places_m - places_m.mean(axis=1, keepdims=True)
    momenta = arms_m[..., 0] * velocities_m_s[..., 1] - arms_m[..., 1] * velocities_m_s[..., 0]
    speeds_m_s = np.hypot(velocities_m_s[..., 0], velocities_m_s[..., 1])
    lengths = np.hypot(arms_m[..., 0], arms_m[..., 1]) * speeds_m_s
    shares = np.where(speeds_m_s > _STILL_M_S, momenta / np.maximum(lengths, 1e-12), 0.0)
    return np.abs(shares.mean(axis=1))


def consensus_error(values: np.ndarray) -> np.ndarray:
    """Return the root mean square distance of values (W, N, K) from their mean in each world."""
    off = values - values.mean(axis=1, keepdims=True)
    error: np.ndarray = np.sqrt((off * off).sum(axis=2).mean(axis=1))
    return error
