"""Arrays that grow on the disk, not in memory: what runs record. A file has its name once it is whole."""

import os
from typing import Any, Tuple

import numpy as np


class Stream:
    """An array (T, ...) of single precision that is written entry by entry.

    Attributes:
        count: entries that were written.
    """

    def __init__(self, path: str, shape: Tuple[int, ...]) -> None:
        """Begin an array of shape (T, ...), which replaces the file path (.npy) when it is closed."""
        self.count = 0
        self._path = path
        self._array: Any = np.lib.format.open_memmap(  # type: ignore[no-untyped-call]
            path + ".part", mode="w+", dtype=np.float32, shape=shape)

    def append(self, values: np.ndarray) -> None:
        """Write the next entry."""
        self._array[self.count] = values
        self.count += 1

    def close(self) -> None:
        """Give the file its name; entries that were not written are nan."""
        self._array[self.count :] = np.nan
        self._array.flush()
        del self._array
        os.replace(self._path + ".part", self._path)
