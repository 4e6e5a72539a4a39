"""Readings of eight infrared sensors, each turned to a wall in turn -> their constants. Pure.

signal = alpha * cos(angle) / distance^2 + offset; the firmware takes range = sqrt(alpha / signal), so what it needs is
alpha = signal * distance^2 at 10 cm, the offset included. A robot that does not face the wall quite straight reads
less. By how much it is turned is seen from the two neighbours, at 45 degrees on both sides: turned to the left, the
right one is nearer. Source of the model: measurements that the robot's authors published.
"""

import math
from typing import List, NamedTuple, Sequence

import numpy as np

from hero_client.robot_constants import BODY_RADIUS_M

from .errors import CalibrationError

BEAMS = 8
BEAM_STEP_RAD = math.pi / 4.0
AHEAD = 4
"""Sensors count counter-clockwise from straight behind."""

WALL_M = 0.10
"""From the body to the wall."""

NOMINAL_COUNTS_M2 = 0.42
NEAR_COUNTS = 16.0
"""A sensor that reads more has something within about 16 cm of the body: too near to turn or to measure beside."""

WALL_COUNTS = (22.0, 110.0)
"""What a sensor may read of a wall at 10 cm: 42 is usual."""

CHECK_SAMPLES = 10
"""Least scans of a sensor in the check: of ten, noise of 1.3 counts moves the range by 0.5 mm."""

FAINT_COUNTS = 0.5
NO_WALL_COUNTS = 4.0
"""A neighbour that looks at the wall from 45 degrees reads 12; of two that see less than this none does."""

LARGEST_TURN_RAD = math.radians(12.0)
PLAUSIBLE_COUNTS_M2 = (0.15, 1.2)


class Facing(NamedTuple):
    """What was seen while one sensor faced the wall.

    Attributes:
        sensor: index of the sensor.
        counts: mean readings of all eight.
        ranges_m: mean ranges of all eight as the robot has them (from its centre); NaN if it has no calibration.
        moved_m: how much nearer to the wall the robot's centre had come since the first one.
    """

    sensor: int
    counts: Sequence[float]
    ranges_m: Sequence[float]
    moved_m: float


def read_signals(intensities: Sequence[float]) -> List[float]:
    """Return the eight readings in a LaserScan of the stock robot, whose odd values are averages."""
    return [float(value) for value in intensities[::2]]


def count_check_samples(samples: int) -> int:
    """Return how many scans of each sensor the check takes, after a first turn that took samples."""
    return max(CHECK_SAMPLES, samples // 3)


def average(scans: np.ndarray) -> np.ndarray:
    """Return the mean of scans (N, ...) without the highest and the lowest fifth.

    A scan that the network held back is one of the robot while it still turned.
    """
    cut = len(scans) // 5
    return np.asarray(np.sort(scans, axis=0)[cut : len(scans) - cut].mean(axis=0))


def estimate_distance_m(counts: float) -> float:
    """Return how far from the body something of these counts is, for a usual sensor; inf: nothing."""
    return math.sqrt(NOMINAL_COUNTS_M2 / counts) if counts > 1.0 else math.inf


def name_beam(sensor: int) -> str:
    """Return where a sensor looks, in words."""
    return ("behind", "behind right", "right", "ahead right", "ahead", "ahead left", "left", "behind left")[
        sensor
    ]


def expected_brightness(angle_rad: float, wall_m: float) -> float:
    """Return signal / alpha of a sensor that looks at angle_rad from the wall's normal (1/m^2).

    wall_m: from the robot's centre to the wall.
    """
    distance_m = wall_m / math.cos(angle_rad) - BODY_RADIUS_M
    return math.cos(angle_rad) / distance_m**2


def estimate_turn_rad(facing: Facing) -> float:
    """Return by how much the robot is turned too far to the left, from the neighbours of the sensor that faces.

    Raises: CalibrationError if they see nothing or it is turned too far.
    """
    neighbours = ((facing.sensor + 1) % BEAMS, (facing.sensor - 1) % BEAMS)
    left, right = (max(facing.counts[index], FAINT_COUNTS) for index in neighbours)
    if max(left, right) <= NO_WALL_COUNTS:
        raise CalibrationError(
            "the sensors beside the one that looks %s see no wall: is it wider than 30 cm, and white?"
            % name_beam(facing.sensor)
        )
    wall_m = WALL_M + BODY_RADIUS_M - facing.moved_m
    step_rad = math.radians(1.0)
    slope = (
        2.0
        * (
            math.log(expected_brightness(BEAM_STEP_RAD - step_rad, wall_m))
            - math.log(expected_brightness(BEAM_STEP_RAD, wall_m))
        )
        / step_rad
    )
    # Turned to the left, the right neighbour comes nearer to the wall's normal.
    turn_rad = math.log(right / left) / slope
    if abs(turn_rad) > LARGEST_TURN_RAD:
        raise CalibrationError(
            "stands %.0f degrees askew to the wall when it looks %s: place it straight, or clean its wheels"
            % (abs(math.degrees(turn_rad)), name_beam(facing.sensor))
        )
    return turn_rad


def compute_calibration(facings: Sequence[Facing]) -> List[float]:
    """Return alpha of all sensors (counts m^2), by their index.

    Raises: CalibrationError if a sensor reads what no wall at 10 cm gives.
    """
    alphas = [math.nan] * BEAMS
    for facing in facings:
        counts = facing.counts[facing.sensor]
        if not WALL_COUNTS[0] <= counts <= WALL_COUNTS[1]:
            raise CalibrationError(
                "the sensor that looks %s reads %.0f counts; %.0f are usual for a white wall 10 cm away: place it anew"
                % (name_beam(facing.sensor), counts, NOMINAL_COUNTS_M2 / WALL_M**2)
            )
        # What it would read straight ahead at 10 cm.
        brightness = expected_brightness(estimate_turn_rad(facing), WALL_M + BODY_RADIUS_M - facing.moved_m)
        alphas[facing.sensor] = counts / brightness
    wrong = [
        index
        for index, alpha in enumerate(alphas)
        if not PLAUSIBLE_COUNTS_M2[0] <= alpha <= PLAUSIBLE_COUNTS_M2[1]
    ]
    if wrong:
        raise CalibrationError(
            "the sensor that looks %s would get %.2f counts m^2, which no sensor has"
            % (name_beam(wrong[0]), alphas[wrong[0]])
        )
    return alphas


def range_errors_m(facings: Sequence[Facing]) -> np.ndarray:
    """Return how much too far each sensor saw the wall that it faced, by its index; NaN if it saw none."""
    errors = np.full(BEAMS, np.nan)
    for facing in facings:
        errors[facing.sensor] = facing.ranges_m[facing.sensor] - (WALL_M + BODY_RADIUS_M - facing.moved_m)
    return errors
