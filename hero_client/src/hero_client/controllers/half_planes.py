"""Velocities of a point in front of a robot's axle, and the nearest of them that half planes allow, for many robots.

A robot with two wheels cannot move sideways, but a point LOOKAHEAD_M in front of its axle can. Laws that keep robots
apart put a disc around it, larger than the body by LOOKAHEAD_M and MARGIN_M, and allow velocities v with
normal . v >= bound. Pure: numpy only. Arrays: robots R, half planes K each.
"""

from typing import Any, Tuple

import numpy as np

LOOKAHEAD_M = 0.03
"""Distance of the point in front of the axle; small: quick turns, large: wide berth."""

FAR_LOOKAHEAD_M = 0.06
"""The same of laws that keep no robots apart: it halves their turns."""

MARGIN_M = 0.012
"""Free space around the body for poses that are late or wrong and for wheels that lag."""

NEIGHBORS = 6
"""Number of nearest robots that count: more do not fit around one."""

_SWEEPS = 16


def steer(
    forward_m_s: Any,
    left_m_s: Any,
    max_linear_m_s: float,
    lookahead_m: float = FAR_LOOKAHEAD_M,
    max_angular_rad_s: float = 2.5,
) -> Tuple[np.ndarray, np.ndarray]:
    """Return linear m/s and angular rad/s that move the point with this velocity, as seen from the robot.

    What is faster than the limits is slowed down in its direction.
    """
    angular_rad_s = left_m_s / lookahead_m
    excess = np.maximum(np.abs(forward_m_s) / max_linear_m_s, np.abs(angular_rad_s) / max_angular_rad_s)
    excess = np.maximum(excess, 1.0)
    return forward_m_s / excess, angular_rad_s / excess


def nearest_allowed(
    wanted: np.ndarray, normals: np.ndarray, bounds: np.ndarray, max_speed_m_s: float, softness: float = 0.0
) -> np.ndarray:
    """Return the allowed velocities (R, 2) nearest to wanted (R, 2).

    normals (R, K, 2) of length 1, bounds (R, K); -inf for a half plane that is not there. Where none is allowed, the
    velocity is a compromise, which may be faster than wanted but not than max_speed_m_s. softness: each half plane
    gives way by this share of what it changes, so that all give way alike where none is allowed. Method: Hildreth's
    procedure, dual coordinate ascent on the quadratic program (C. Hildreth, A quadratic programming procedure, 1957).
    """
    velocities = wanted.T.copy()
    present = np.isfinite(bounds)
    limits = np.where(present, bounds, -1e9).T.copy()
    across = np.where(present[..., None], normals, 0.0).transpose(1, 2, 0).copy()
    pushes = np.zeros_like(limits)
    for _ in range(_SWEEPS):
        for normal, limit, push in zip(across, limits, pushes):
            lacking = limit - (normal[0] * velocities[0] + normal[1] * velocities[1]) - softness * push
            change = np.maximum(lacking / (1.0 + softness), -push)
            push += change
            velocities += normal * change
    speeds = np.hypot(*velocities)
    velocities *= np.minimum(1.0, max_speed_m_s / np.maximum(speeds, 1e-9))
    return velocities.T
