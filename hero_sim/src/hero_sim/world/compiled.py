"""Compiles the loops over wheels and bodies with numba where it is installed; without, the same source runs on lists.

Both give the same bytes: numba contracts and reorders nothing by default (no fastmath), and only operations
that IEEE 754 defines to the last bit are used.
"""

import importlib
from functools import lru_cache
from types import FunctionType, SimpleNamespace
from typing import Any, Optional

from . import body_loops, wheel_loops

COMPILED_ROWS = 50
"""For fewer robots loading numba, about 0.5 s, takes longer than it saves."""


@lru_cache(maxsize=None)
def _compile_loops() -> Optional[Any]:
    """Return the functions of both modules compiled, as attributes, or None without numba."""
    try:
        numba = importlib.import_module("numba")
    except ImportError:
        return None
    loops = SimpleNamespace()
    for module in (wheel_loops, body_loops):
        names = dict(vars(module))
        for name, loop in vars(module).items():
            if isinstance(loop, FunctionType):
                # In these names, for it to call the others compiled.
                names[name] = numba.njit(cache=True)(FunctionType(loop.__code__, names, name))
                setattr(loops, name, names[name])
    return loops


def compile_loops(rows: int) -> Optional[Any]:
    """Return the functions of both modules compiled, as attributes; None for few rows and without numba."""
    return _compile_loops() if rows >= COMPILED_ROWS else None
