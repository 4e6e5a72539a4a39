"""Conversion of infrared counts into ranges by the firmware (RangeSensor.ino). Pure."""

import numpy as np

from hero_node.robot_constants import BODY_RADIUS_M

FACTORY_CALIBRATION_COUNTS_M2 = 0.5
"""The firmware's calibration of every sensor until the robot is calibrated."""

CALIBRATION_DISTANCE_M = 0.10
"""Distance of the wall when a robot is calibrated: alpha_i = mean(signal) * 0.10^2."""

MIN_DISTANCE_M = 0.01
MAX_DISTANCE_M = 0.22
"""Clamp of the firmware's distance, before it adds the body radius (RangeSensor.ino:123)."""


def calibrate(alpha_counts_m2: np.ndarray, beta_counts: np.ndarray) -> np.ndarray:
    """Return the calibration that a robot with these sensors gets from a wall at 10 cm (counts m^2)."""
    square_m2 = CALIBRATION_DISTANCE_M**2
    return (alpha_counts_m2 / square_m2 + beta_counts) * square_m2


def convert_to_ranges(counts: np.ndarray, calibration_counts_m2: np.ndarray) -> np.ndarray:
    """Return the firmware's ranges (m from the robot's center): NaN for a calibration that is erased.

    Nothing in range gives 0.2568 m, above the firmware's own range_max of 0.2368 m (RangeSensor.ino:123-125).
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        distance_m = np.sqrt(calibration_counts_m2 / np.asarray(counts, dtype=float))
    # NaN goes through unchanged, as through the firmware's constrain().
    return BODY_RADIUS_M + np.minimum(np.maximum(distance_m, MIN_DISTANCE_M), MAX_DISTANCE_M)
