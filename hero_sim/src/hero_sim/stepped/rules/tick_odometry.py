"""Odometry from wheel ticks as the driver computes it, for all robots at once.

Pure: numpy only, robots last in all arrays; the formulas of hero_driver's corrections/tick_odometry.py. A heading is
kept as an angle and as its cosine and sine, which give the same bytes on every machine.
"""

import math
from typing import Optional, Sequence

import numpy as np

from hero_driver.corrections import TWIST_WINDOW, WheelGeometry

from ...world import body_loops, compile_loops
from ...world.body_loops import follow_arc, shape_arc
from ...world.kinematics import find_heading, join_wheels

_TURN_RAD = 2.0 * math.pi


class TickOdometryRows:
    """The odometry of all robots.

    Attributes:
        poses: x m, y m, yaw rad from -pi to pi in hero_N/odom (3, R), changed in place.
    """

    def __init__(self, wheels: Sequence[WheelGeometry]) -> None:
        """Begin at the origin, without a reading; wheels of each robot, the left like the right."""
        rows = len(wheels)
        self._tick_m = np.array([geometry.ticks_m[0] for geometry in wheels])
        self._separation_m = np.array([geometry.wheel_separation_m for geometry in wheels])
        self.poses = np.zeros((3, rows))
        self._headings = np.array((np.ones(rows), np.zeros(rows)))
        self._window_ticks = np.zeros((TWIST_WINDOW, 2, rows))
        self._window_ms = np.zeros((TWIST_WINDOW, rows), dtype=np.int64)
        self._newest = 0
        self._is_cleared = np.ones(rows, dtype=bool)
        self._any_cleared = True
        self._velocities: Optional[np.ndarray] = None
        self._loops = compile_loops(body_loops, rows)

    def set_pose(self, row: int, x_m: float, y_m: float, yaw_rad: float) -> None:
        """One robot's odometry was set, which zeroed its counters."""
        self.poses[:, row] = x_m, y_m, math.remainder(yaw_rad, _TURN_RAD)
        self._headings[:, row] = find_heading(self.poses[2, row])
        self._window_ticks[self._newest, :, row] = 0.0
        self._is_cleared[row] = self._any_cleared = True
        self._velocities = None

    def integrate(self, ticks: np.ndarray, now_ms: int) -> None:
        """Take one reading of all counters (2, R), with its stamp."""
        moved_ticks = ticks - self._window_ticks[self._newest]
        if self._loops is not None:
            self._loops.follow_wheels(moved_ticks, self._tick_m, self._separation_m, self.poses, self._headings)
        else:
            left_m, right_m = moved_ticks * self._tick_m
            travels_m, turns_rad = join_wheels(left_m, right_m, self._separation_m)
            cosine, sine = self._headings
            step_x_m, step_y_m, cosine[:], sine[:] = follow_arc(cosine, sine, *shape_arc(travels_m, turns_rad))
            self.poses += step_x_m, step_y_m, turns_rad
            self.poses[2] -= np.rint(self.poses[2] / _TURN_RAD) * _TURN_RAD
        self._velocities = None
        self._newest = (self._newest + 1) % TWIST_WINDOW
        self._window_ticks[self._newest], self._window_ms[self._newest] = ticks, now_ms
        if self._any_cleared:
            # The first reading replaces all those before it.
            self._window_ticks[:, :, self._is_cleared] = ticks[:, self._is_cleared]
            self._window_ms[:, self._is_cleared] = now_ms
            self._is_cleared[:] = self._any_cleared = False

    def measure_velocities(self) -> np.ndarray:
        """Return linear m/s and angular rad/s over the last TWIST_WINDOW readings (2, R)."""
        if self._velocities is None:
            oldest = (self._newest + 1) % TWIST_WINDOW
            elapsed_ms = np.maximum(self._window_ms[self._newest] - self._window_ms[oldest], 1)
            rolled_m = (self._window_ticks[self._newest] - self._window_ticks[oldest]) * self._tick_m
            left_m_s, right_m_s = rolled_m / (elapsed_ms / 1000.0)
            self._velocities = np.array(join_wheels(left_m_s, right_m_s, self._separation_m))
            self._velocities[:, self._is_cleared] = 0.0
        return self._velocities
