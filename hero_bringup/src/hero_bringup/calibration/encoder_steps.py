"""Steps between encoder readings: how long a tick is, and which steps say something about time. Pure.

The robot stamps its readings. Its clock is set anew every 2.5 s (docs/robot_interface.md), by 70 ms and more after the
network stood still; set back, steps are microseconds long until the stamps have caught up, set ahead, one is too long.
"""

import numpy as np

TICK_M = 0.0492 * np.pi / 288.0
"""Way of a wheel's rim for a tick (docs/robot_interface.md)."""

USUAL = (0.75, 1.35)
"""A step of this many usual ones is one in which the clock ran on; a stock robot's steps are 0.9 to 1.1 usual ones."""


def find_true_steps(stamps_s: np.ndarray, apart: int) -> np.ndarray:
    """Return for each two readings so many apart whether the robot's clock ran on between them (bool, len - apart).

    stamps_s: rising.
    """
    if len(stamps_s) <= apart:
        return np.zeros(0, dtype=bool)
    steps_s = np.diff(stamps_s)
    shares = steps_s / np.median(steps_s)
    is_true = (shares >= USUAL[0]) & (shares <= USUAL[1])
    return np.convolve(is_true, np.ones(apart), "valid") == apart
