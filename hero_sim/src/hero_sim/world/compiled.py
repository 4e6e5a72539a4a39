"""Compiles loops over numbers with numba where it is installed; without, the same source runs on lists.

Both give the same bytes: numba contracts and reorders nothing by default (no fastmath), and only operations
that IEEE 754 defines to the last bit are used.
"""

import importlib
from functools import lru_cache
from typing import Any, Callable, Optional

import numpy as np

Loop = Callable[..., None]

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


def compile_loop(loop: Loop, rows: int) -> Loop:
    """Return a function with the arguments and results of loop, all numbers or arrays with one axis, for so many rows.

    loop changes its arrays in place and returns nothing.
    """
    compiled = _compile(loop) if rows >= COMPILED_ROWS else None
    if compiled is not None:
        return compiled

    def run(*arguments: Any) -> None:
        # Single reads from lists are several times faster than from arrays.
        lists = [argument.tolist() if isinstance(argument, np.ndarray) else argument for argument in arguments]
        loop(*lists)
        for argument, values in zip(arguments, lists):
            if isinstance(argument, np.ndarray) and argument.dtype == float:
                argument[:] = values

    return run
