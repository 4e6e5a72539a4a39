"""Which robots take part in something: a mask over robots, or all of them, for which numpy is faster without a mask."""

from typing import Union

import numpy as np

__all__ = ["Which", "assign", "simplify"]

Which = Union[bool, np.ndarray]
"""A mask (R,), or True for all robots."""


def assign(target: np.ndarray, values: Union[int, np.ndarray], which: Which) -> None:
    """Copy values into target, arrays with robots last, for those that take part."""
    if which is True:
        target[...] = values
    else:
        np.copyto(target, values, where=which)


def simplify(which: np.ndarray) -> Which:
    """Return True instead of a mask of all robots."""
    return True if np.count_nonzero(which) == len(which) else which
