"""Times at which the camera takes its images, and at which they arrive. Pure; deterministic by seed."""

from typing import Iterator, Tuple

import numpy as np

from .view import CameraOptions


def list_frames(options: CameraOptions, start_s: float = 0.0, seed: int = 0) -> Iterator[Tuple[float, float]]:
    """Yield the middle of the exposure and the arrival of images from start_s on, without end.

    Dropped ones are left out. None overtakes another.
    """
    random = np.random.RandomState(seed)
    index, arrival_s = 0, -np.inf
    while True:
        stamp_s = start_s + index / options.rate_hz
        late_s = random.random_sample() * options.delay_jitter_s
        is_dropped = random.random_sample() < options.dropped_share
        index += 1
        if not is_dropped:
            arrival_s = max(arrival_s, stamp_s + options.delay_s + late_s)
            yield stamp_s, float(arrival_s)
