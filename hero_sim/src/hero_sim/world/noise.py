"""Random numbers that are the same on every machine. Pure."""

from typing import Tuple

import numpy as np


def draw_normal(rng: np.random.RandomState, shape: Tuple[int, ...]) -> np.ndarray:
    """Return standard normal numbers, rounded to single precision.

    The last bits of the logarithm that they are drawn with depend on the machine's C library; rounded they agree.
    """
    return rng.standard_normal(shape).astype(np.float32).astype(float)
