"""Ranges of all robots' infrared sensors as the driver corrects them.

Pure: numpy only; the corrections of make_proximity() in hero_driver's corrections/message_layouts.py.
"""

import numpy as np

from hero_driver.corrections import CLAMP_TOLERANCE_M
from hero_driver.robot_constants import BODY_RADIUS_M, MAX_RIM_RANGE_M, MIN_RIM_RANGE_M

from ...world.range_sensors import BEAMS

_FRONT_FIRST = np.roll(np.arange(BEAMS), BEAMS // 2)


def correct_ranges(ranges_m: np.ndarray) -> np.ndarray:
    """Return ranges of /laser (R, 8) as programs see them, front first: inf for nothing in range, 0 for too close.

    NaN for a sensor that is not calibrated stays.
    """
    corrected_m = ranges_m.take(_FRONT_FIRST, axis=1)
    with np.errstate(invalid="ignore"):  # comparisons with NaN
        near = corrected_m <= BODY_RADIUS_M + MIN_RIM_RANGE_M + CLAMP_TOLERANCE_M
        far = corrected_m >= BODY_RADIUS_M + MAX_RIM_RANGE_M - CLAMP_TOLERANCE_M
    corrected_m[near] = 0.0
    corrected_m[far] = np.inf
    return corrected_m
