"""Compiles loops over robots with numba where it is installed; without, those over bodies run on lists.

Both give the same bytes: numba contracts and reorders nothing by default (no fastmath), and only operations
that IEEE 754 defines to the last bit are used.
"""

import importlib
from functools import lru_cache
from types import FunctionType, ModuleType, SimpleNamespace
from typing import Any, Optional

COMPILED_ROWS = 40
"""For fewer robots loading numba, about 0.5 s, takes longer than it saves."""


@lru_cache(maxsize=None)
def _compile_loops(module: ModuleType) -> Optional[Any]:
    """Return the functions of a module compiled, as attributes, or None without numba."""
    try:
        numba = importlib.import_module("numba")
    except ImportError:
        return None
    loops, names = SimpleNamespace(), {**vars(module), "IS_COMPILED": True}
    for name, loop in vars(module).items():
        if isinstance(loop, FunctionType):
            # In these names, for it to call the others compiled. Divisions by zero give inf or nan, as in arrays.
            names[name] = numba.njit(cache=True, error_model="numpy")(FunctionType(loop.__code__, names, name))
            setattr(loops, name, names[name])
    return loops


def compile_loops(module: ModuleType, rows: int) -> Optional[Any]:
    """Return the functions of a module compiled, as attributes; None for few rows and without numba."""
    return _compile_loops(module) if rows >= COMPILED_ROWS else None
