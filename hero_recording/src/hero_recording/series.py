"""Collects rows of numbers into arrays, compactly. Pure."""

from array import array
from typing import List, Tuple

import numpy as np

LARGEST_VALUE = 1e6


class Series:
    """Rows of numbers: first times, kept exactly, then values, kept to seven digits.

    A row of a time and six values takes 32 bytes: ten minutes of a robot's odometry, 560 kB.

    Attributes:
        skipped: rows that were refused because a value is not finite, or beyond what a robot can measure.
    """

    def __init__(self, times: int, values: int) -> None:
        """Start empty; times and values are the numbers of columns."""
        self.skipped = 0
        self._times = times
        self._columns: List[array[float]] = [array("d") for _ in range(times)]
        self._columns += [array("f") for _ in range(values)]

    def __len__(self) -> int:
        return len(self._columns[0])

    def add(self, *row: float) -> None:
        """Add a row, unless a value is absurd: a single one would set the scale of a whole figure."""
        if not all(abs(value) <= LARGEST_VALUE for value in row[self._times :]):
            self.skipped += 1
            return
        for column, number in zip(self._columns, row):
            column.append(number)

    def columns(self) -> Tuple[np.ndarray, ...]:
        """Return one array per column, times as float64, values as float32; add() must not follow."""
        return tuple(
            np.frombuffer(column, dtype=column.typecode) if column else np.zeros(0) for column in self._columns
        )
