"""Checks of numbers from files, parameters and pages: True and False (ints of Python) and NaN are refused. Pure."""

import math
import sys
from numbers import Real
from typing import Any

MAX_FLOAT = sys.float_info.max
"""Larger ints cannot become floats."""


def is_number(value: Any, low: float = -MAX_FLOAT, high: float = MAX_FLOAT) -> bool:
    """Return whether value is a number in low..high, and finite where no limits are given."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and low <= value <= high


def is_whole_number(value: Any, low: float = -MAX_FLOAT, high: float = MAX_FLOAT) -> bool:
    """Return whether value is an int in low..high."""
    return isinstance(value, int) and is_number(value, low, high)


def is_finite(value: object) -> bool:
    """Return whether value, which may be of numpy, is a number and neither infinite nor NaN."""
    # float first: asking an abstract class takes longer, and stepped robots are sent thousands of speeds per second.
    try:
        return isinstance(value, (float, Real)) and math.isfinite(value)
    except OverflowError:  # an int that no float can be
        return False


def check_finite(what: str, *values: object) -> None:
    """Check that all are finite numbers. Raises: ValueError."""
    if not all(map(is_finite, values)):
        raise ValueError(f"{what} must be finite numbers, not {', '.join(map(repr, values))}")


def check_speed(distance: float, speed: float) -> None:
    """Check that a distance or angle is finite, and a speed positive. Raises: ValueError."""
    if not (is_finite(distance) and is_finite(speed) and speed > 0.0):
        raise ValueError(f"distance or angle must be finite, the speed positive, not {distance!r} and {speed!r}")
