"""Random numbers that are the same on every machine. Pure."""

from typing import Sequence, Tuple

import numpy as np

from .wheel_loops import draw_normal_at, find_place

_CACHED = 8192
"""Numbers that are computed at once: they fit the processor's cache."""


def draw_normal(rng: np.random.RandomState, shape: Tuple[int, ...]) -> np.ndarray:
    """Return standard normal numbers, rounded to single precision.

    The last bits of the logarithm that they are drawn with depend on the machine's C library; rounded they agree.
    """
    return rng.standard_normal(shape).astype(np.float32).astype(float)


def draw_keys(rngs: Sequence[np.random.RandomState]) -> np.ndarray:
    """Return the key of a stream for each of rngs."""
    return np.array([rng.randint(0, 2**63 - 1, dtype=np.int64) for rng in rngs]).astype(np.uint64)


def draw_steps(keys: np.ndarray, first_step: int, steps: int, channels: int, robots: int) -> np.ndarray:
    """Return the numbers of steps (K, channels, R) of R robots, world after world, from the streams keys (W,)."""
    drawn = np.empty((steps, channels, len(keys), robots))
    own = find_place(0, np.arange(channels).reshape(-1, 1, 1), np.arange(robots))
    at_once = max(1, _CACHED // drawn[0].size)
    for begin in range(0, steps, at_once):
        numbers = np.arange(first_step + begin, first_step + min(begin + at_once, steps))
        drawn[begin : begin + at_once] = draw_normal_at(
            keys[:, None], own + find_place(numbers, 0, 0).reshape(-1, 1, 1, 1)
        )
    return drawn.reshape(steps, channels, -1)
