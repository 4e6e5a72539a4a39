"""Computes the constants of eight infrared sensors from their readings of a wall that each has faced. Pure.

signal = alpha * cos(angle) / distance^2 + offset; the firmware takes range = sqrt(alpha / signal), so it needs
alpha = signal * distance^2 at 10 cm, including the offset. A misaligned robot reads less. Its misalignment follows from
the two neighboring sensors at 45 degrees: turned to the left, the right one is nearer to the wall. Source of the model:
measurements published by the robot's authors.
"""

import math
from typing import List, NamedTuple, Optional, Sequence

import numpy as np

from hero_node.robot_constants import BEAM_NAMES, BEAMS, BODY_RADIUS_M

from ..errors import CalibrationError

BEAM_STEP_RAD = math.pi / 4.0
FRONT = 4
"""Sensors are numbered counter-clockwise from the rear."""

WALL_M = 0.10
"""Distance from the body to the wall."""

NOMINAL_COUNTS_M2 = 0.42
NEAR_COUNTS = 16.0
"""A sensor reads more if something is within about 16 cm of the body: too close to turn or to measure beside."""

WALL_COUNTS = (22.0, 110.0)
"""Accepted readings of a wall at 10 cm: 42 is typical."""

SAMPLES = 25
"""Scans of each sensor in the first round, five a second."""

CHECK_SAMPLES = 10
"""The same in the check: noise of 1.3 counts then moves the range by 0.5 mm."""

FAINT_COUNTS = 0.5
NO_WALL_COUNTS = 4.0
"""A neighbor that sees the wall at 45 degrees reads 12; if both read less than this, neither sees it."""

MAX_MISALIGNMENT_RAD = math.radians(12.0)
PLAUSIBLE_COUNTS_M2 = (0.15, 1.2)


class Facing(NamedTuple):
    """Means of all eight sensors while one of them (its index) faced the wall.

    ranges_m: as the robot computes them (from its center); NaN without a calibration.
    moved_m: how much closer to the wall the robot's center is than at the first sensor.
    """

    sensor: int
    counts: Sequence[float]
    ranges_m: Sequence[float]
    moved_m: float


def read_signals(intensities: Sequence[float]) -> List[float]:
    """Return the eight readings in a LaserScan of the robot, whose odd values are averages."""
    return [float(value) for value in intensities[::2]]


def average(scans: np.ndarray) -> np.ndarray:
    """Return the mean of scans (N, ...) without the highest and the lowest fifth.

    A scan that the network delayed may show the robot while it still turned.
    """
    cut = len(scans) // 5
    return np.asarray(np.sort(scans, axis=0)[cut : len(scans) - cut].mean(axis=0))


def expected_brightness(angle_rad: float, wall_m: float) -> float:
    """Return signal / alpha (1/m^2) of a sensor at angle_rad from the wall's normal.

    wall_m: from the robot's center to the wall.
    """
    distance_m = wall_m / math.cos(angle_rad) - BODY_RADIUS_M
    return math.cos(angle_rad) / distance_m**2


def estimate_misalignment_rad(facing: Facing) -> float:
    """Return how far the robot is turned too far to the left, by the neighbors of the sensor that faces the wall.

    Raises: CalibrationError if they see nothing or it is turned too far.
    """
    neighbors = ((facing.sensor + 1) % BEAMS, (facing.sensor - 1) % BEAMS)
    left, right = (max(facing.counts[index], FAINT_COUNTS) for index in neighbors)
    if max(left, right) <= NO_WALL_COUNTS:
        text = f"the sensors beside {BEAM_NAMES[facing.sensor]} see no wall: is it wider than 30 cm, and white?"
        raise CalibrationError(text)
    wall_m = WALL_M + BODY_RADIUS_M - facing.moved_m
    step_rad = math.radians(1.0)
    at, beside = (math.log(expected_brightness(BEAM_STEP_RAD - offset_rad, wall_m)) for offset_rad in (0.0, step_rad))
    slope = 2.0 * (beside - at) / step_rad
    # Turned to the left, the right neighbor comes closer to the wall's normal.
    misalignment_rad = math.log(right / left) / slope
    if abs(misalignment_rad) > MAX_MISALIGNMENT_RAD:
        text = "misaligned by %.0f degrees when sensor %s faces the wall: place it straight, or clean its wheels"
        raise CalibrationError(text % (abs(math.degrees(misalignment_rad)), BEAM_NAMES[facing.sensor]))
    return misalignment_rad


def compute_calibration(facings: Sequence[Facing]) -> List[float]:
    """Return alpha of all sensors (counts m^2), by index.

    Raises: CalibrationError if a sensor reads what no wall at 10 cm gives.
    """
    alphas = [math.nan] * BEAMS
    for facing in facings:
        counts = facing.counts[facing.sensor]
        if not WALL_COUNTS[0] <= counts <= WALL_COUNTS[1]:
            text = "sensor %s reads %.0f counts; %.0f are typical of a white wall 10 cm away: place it again"
            raise CalibrationError(text % (BEAM_NAMES[facing.sensor], counts, NOMINAL_COUNTS_M2 / WALL_M**2))
        # Relative to a straight view of the wall at 10 cm.
        brightness = expected_brightness(estimate_misalignment_rad(facing), WALL_M + BODY_RADIUS_M - facing.moved_m)
        alphas[facing.sensor] = counts / brightness
    low, high = PLAUSIBLE_COUNTS_M2
    for index, alpha in enumerate(alphas):
        if not low <= alpha <= high:
            raise CalibrationError(f"sensor {BEAM_NAMES[index]} would get {alpha:.2f} counts m^2: none has")
    return alphas


def range_errors_m(facings: Sequence[Facing]) -> np.ndarray:
    """Return how much too far each sensor saw the wall that it faced, by index; NaN if it saw none."""
    errors = np.full(BEAMS, np.nan)
    for facing in facings:
        errors[facing.sensor] = facing.ranges_m[facing.sensor] - (WALL_M + BODY_RADIUS_M - facing.moved_m)
    return errors


def find_obstacle(counts: Sequence[float], at_wall: bool) -> Optional[str]:
    """Return what is too close to a robot, as text; None if nothing is.

    counts: raw readings: they work before the sensors are calibrated.
    at_wall: whether it should face a wall; otherwise it needs room on all sides.
    """
    low, high = WALL_COUNTS
    if at_wall and not low <= counts[FRONT] <= high:
        return "its front sensor reads %.0f counts; %.0f are typical of a white wall 10 cm away" % (
            counts[FRONT],
            NOMINAL_COUNTS_M2 / WALL_M**2,
        )
    facing_wall = (FRONT - 1, FRONT, FRONT + 1) if at_wall else ()
    free = [sensor for sensor in range(BEAMS) if sensor not in facing_wall]
    nearest = max(free, key=lambda sensor: counts[sensor])
    if counts[nearest] <= NEAR_COUNTS:
        return None
    distance_cm = 100.0 * math.sqrt(NOMINAL_COUNTS_M2 / counts[nearest])
    return f"something is about {distance_cm:.0f} cm from it, at sensor {BEAM_NAMES[nearest]}"
