"""Checks of numbers that users give, also those of numpy. Pure."""

import math
from numbers import Real

__all__ = ["check_finite", "is_finite"]


def is_finite(value: object) -> bool:
    """Return whether value is a number, and neither infinite nor NaN."""
    return isinstance(value, Real) and math.isfinite(value)


def check_finite(what: str, *values: object) -> None:
    """Check that all are finite numbers. Raises: ValueError."""
    if not all(map(is_finite, values)):
        raise ValueError("%s must be finite numbers, not %s" % (what, ", ".join(map(repr, values))))
