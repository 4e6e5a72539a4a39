"""Which robots take part in something: a mask over robots, or all of them, for which numpy is faster without a mask."""

from typing import Union

import numpy as np

RobotMask = Union[bool, np.ndarray]
"""A mask (R,), or True for all robots, or False for none."""


def simplify(which: np.ndarray) -> RobotMask:
    """Return True or False instead of a mask of all robots or none."""
    count = np.count_nonzero(which)
    return which if 0 < count < len(which) else bool(count)
