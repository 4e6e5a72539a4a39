"""Checks of numbers from files, parameters and pages: True and False (ints of Python) and NaN are none. Pure."""

import sys
from typing import Any

__all__ = ["is_number", "is_whole_number"]

LARGEST = sys.float_info.max
"""Larger ints cannot become floats."""


def is_number(value: Any, low: float = -LARGEST, high: float = LARGEST) -> bool:
    """Return whether value is a number in low..high, and finite where no limits are given."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and low <= value <= high


def is_whole_number(value: Any, low: float = -LARGEST, high: float = LARGEST) -> bool:
    """Return whether value is an int in low..high."""
    return isinstance(value, int) and is_number(value, low, high)
