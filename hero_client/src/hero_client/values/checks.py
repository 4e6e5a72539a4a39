"""Checks of numbers that users give, also those of numpy. Pure."""

import math
from numbers import Real

__all__ = ["check_finite", "check_speed", "is_finite"]


def is_finite(value: object) -> bool:
    """Return whether value is a number, and neither infinite nor NaN."""
    return isinstance(value, Real) and math.isfinite(value)


def check_finite(what: str, *values: object) -> None:
    """Check that all are finite numbers. Raises: ValueError."""
    if not all(map(is_finite, values)):
        raise ValueError("%s must be finite numbers, not %s" % (what, ", ".join(map(repr, values))))


def check_speed(distance: float, speed: float) -> None:
    """Check that a distance or angle is finite, and a speed positive. Raises: ValueError."""
    if not (is_finite(distance) and is_finite(speed) and speed > 0.0):
        raise ValueError("distance or angle must be finite, the speed positive, not %r and %r" % (distance, speed))
