"""Collects rows of numbers into arrays, compactly. Pure."""

from array import array

import numpy as np

MAX_VALUE = 1e6


class Series:
    """Rows of numbers: first times, then values.

    A row of seven numbers takes 56 bytes: ten minutes of a robot's odometry, 1 MB.

    Attributes:
        skipped: rows that were refused because a value is not finite, or beyond what a robot can measure.
    """

    def __init__(self, times: int, values: int) -> None:
        """Start empty; times and values are the numbers of columns."""
        self.skipped = 0
        self._times = times
        self._width = times + values
        self._numbers = array("d")

    def __len__(self) -> int:
        return len(self._numbers) // self._width

    def add(self, *row: float) -> None:
        """Add a row, unless a value is absurd: a single one would set the scale of a whole figure."""
        if all(abs(value) <= MAX_VALUE for value in row[self._times :]):
            self._numbers.extend(row)
        else:
            self.skipped += 1

    def columns(self) -> np.ndarray:
        """Return the numbers (columns, rows); add() must not follow."""
        numbers = np.frombuffer(self._numbers) if self._numbers else np.zeros(0)
        return numbers.reshape(-1, self._width).T
