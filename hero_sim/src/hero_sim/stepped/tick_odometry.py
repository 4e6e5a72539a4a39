"""Odometry from wheel ticks as the driver computes it, for all robots at once.

Pure: numpy only, arrays over robots (R); the formulas of hero_driver's corrections/tick_odometry.py. A heading is kept
as an angle and as its cosine and sine, which are turned on by each reading's small angle: sums and products give the
same bytes on every machine, the library's sine does not.
"""

import math
from typing import Sequence, Tuple

import numpy as np

from hero_driver.corrections.tick_odometry import TWIST_WINDOW

from ..robot_constants import TICK_M
from ..world.kinematics import join_wheels

__all__ = ["TickOdometryRows"]

_COSINE_SERIES = (-1 / 2, 1 / 24, -1 / 720, 1 / 40320, -1 / 3628800)
_SINE_SERIES = (-1 / 6, 1 / 120, -1 / 5040, 1 / 362880, -1 / 39916800)
"""Of the powers 2, 4, ... of a small angle, behind 1."""


class TickOdometryRows:
    """The odometry of all robots.

    Attributes:
        poses: x m, y m, yaw rad in frame hero_N/odom (R, 3).
    """

    def __init__(self, rows: int) -> None:
        """Begin at the origin, without a reading."""
        self.poses = np.zeros((rows, 3))
        self._cosines, self._sines = np.ones(rows), np.zeros(rows)
        self._ticks = np.zeros((rows, 2))
        self._window_ticks = np.zeros((TWIST_WINDOW, rows, 2))
        self._window_ms = np.zeros((TWIST_WINDOW, rows), dtype=np.int64)
        self._newest = 0
        self._is_cleared = np.ones(rows, dtype=bool)
        self._any_cleared = True

    def set_pose(self, row: int, x_m: float, y_m: float, yaw_rad: float) -> None:
        """One robot's odometry was set, which zeroed its counters."""
        self.poses[row] = x_m, y_m, math.remainder(yaw_rad, 2.0 * math.pi)
        self._cosines[row], self._sines[row] = _find_direction(yaw_rad)
        self._ticks[row] = 0.0
        self._is_cleared[row] = self._any_cleared = True

    def integrate(self, ticks: np.ndarray, now_ms: int) -> None:
        """Take one reading of all counters (R, 2), with its stamp."""
        moved = ticks - self._ticks
        if moved.any():
            self._move(*join_wheels(*(moved * TICK_M).T))
        np.copyto(self._ticks, ticks)
        self._keep_reading(ticks, now_ms)

    def _move(self, distance_m: np.ndarray, turn_rad: np.ndarray) -> None:
        """Follow arcs of these lengths and angles (R,)."""
        half_rad = turn_rad / 2.0
        # Two half turns; between them the robot is displaced along the chord.
        cosine, sine_by_angle = _turn_small(half_rad)
        sine = half_rad * sine_by_angle
        chord_m = distance_m * sine_by_angle
        across, along = self._sines * cosine + self._cosines * sine, self._cosines * cosine - self._sines * sine
        self.poses[:, 0] += chord_m * along
        self.poses[:, 1] += chord_m * across
        self._cosines, self._sines = along * cosine - across * sine, across * cosine + along * sine
        yaw_rad = self.poses[:, 2] + turn_rad
        yaw_rad -= np.rint(yaw_rad / (2.0 * math.pi)) * (2.0 * math.pi)
        self.poses[:, 2] = yaw_rad

    def _keep_reading(self, ticks: np.ndarray, now_ms: int) -> None:
        self._newest = (self._newest + 1) % TWIST_WINDOW
        self._window_ticks[self._newest], self._window_ms[self._newest] = ticks, now_ms
        if self._any_cleared:
            # The first reading stands for all those before it.
            self._window_ticks[:, self._is_cleared] = ticks[self._is_cleared]
            self._window_ms[:, self._is_cleared] = now_ms
            self._is_cleared[:] = self._any_cleared = False

    def measure_velocities(self) -> np.ndarray:
        """Return linear m/s and angular rad/s over the last TWIST_WINDOW readings (R, 2)."""
        oldest = (self._newest + 1) % TWIST_WINDOW
        elapsed_ms = np.maximum(self._window_ms[self._newest] - self._window_ms[oldest], 1)
        rolled_m = (self._window_ticks[self._newest] - self._window_ticks[oldest]) * TICK_M
        velocities = np.column_stack(join_wheels(*(rolled_m / (elapsed_ms / 1000.0)[:, None]).T))
        velocities[self._is_cleared] = 0.0
        return velocities


def _turn_small(angle_rad: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return the cosine, and the sine divided by the angle, of angles up to 0.3 rad, to double precision."""
    square = angle_rad * angle_rad
    return _sum_series(square, _COSINE_SERIES), _sum_series(square, _SINE_SERIES)


def _sum_series(square: np.ndarray, coefficients: Sequence[float]) -> np.ndarray:
    total = square * coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        total += coefficient
        total *= square
    total += 1.0
    return total


def _find_direction(yaw_rad: float) -> Tuple[float, float]:
    """Return the cosine and the sine of any angle."""
    part_rad = np.array([math.remainder(yaw_rad, 2.0 * math.pi) / 16.0])
    cosine, by_angle = (values.item() for values in _turn_small(part_rad))
    sine = part_rad.item() * by_angle
    for _ in range(4):
        cosine, sine = cosine * cosine - sine * sine, 2.0 * cosine * sine
    return cosine, sine
