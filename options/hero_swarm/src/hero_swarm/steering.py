"""Wheel commands for a wanted velocity in the body frame. Pure: arrays (R,)."""

from typing import Any, Tuple

import numpy as np


def steer(
    forward_m_s: Any, left_m_s: Any, max_linear_m_s: float, lookahead_m: float = 0.06, max_angular_rad_s: float = 2.5
) -> Tuple[np.ndarray, np.ndarray]:
    """Return linear m/s and angular rad/s that move the point lookahead_m in front of the axle with this velocity.

    What is faster than the limits is slowed down in its direction.
    """
    angular_rad_s = left_m_s / lookahead_m
    excess = np.maximum(np.abs(forward_m_s) / max_linear_m_s, np.abs(angular_rad_s) / max_angular_rad_s)
    excess = np.maximum(excess, 1.0)
    return forward_m_s / excess, angular_rad_s / excess
