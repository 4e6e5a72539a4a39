"""Compiles loops over numbers with numba where it is installed; without, the same source runs on lists.

Both give the same bytes: numba contracts and reorders nothing by default (no fastmath), and only operations
that IEEE 754 defines to the last bit are used.
"""

import importlib
from functools import lru_cache
from typing import Any, Callable, Optional, Sequence, Tuple

import numpy as np

Loop = Callable[..., Any]
Hold = Callable[[np.ndarray], Any]

COMPILED_ROWS = 50
"""For fewer robots loading numba, about 0.5 s, takes longer than it saves."""


@lru_cache(maxsize=None)
def _compile(loop: Loop) -> Optional[Loop]:
    """Return loop compiled, or None without numba."""
    try:
        numba = importlib.import_module("numba")
    except ImportError:
        return None
    compiled: Loop = numba.njit(cache=True)(loop)
    return compiled


def compile_loops(rows: int, *loops: Loop) -> Tuple[Hold, Sequence[Loop]]:
    """Return loops, whose arguments are numbers and arrays with one axis, for this many rows; and hold().

    hold(array) is what the loops read and change: the array, or a list, whose single reads are several times faster.
    """
    compiled = [loop for loop in map(_compile, loops) if loop is not None] if rows >= COMPILED_ROWS else []
    if not compiled:
        return np.ndarray.tolist, loops
    return np.ascontiguousarray, compiled
