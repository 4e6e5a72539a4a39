"""Wheel ticks -> pose and velocity: differential-drive odometry on exact arcs.

The firmware's own integration loses a third and more of the distance while the velocity controller drives
(VelocityControl.ino:112 overwrites what Odometry.ino:130 has not read yet); its tick counters stay right.
Pure: ticks and stamps in, pose and twist out. Source of the geometry: config of the robot, robot's frames
by REP 103 (x ahead, y left, yaw counter-clockwise).
"""

import collections
import math
from dataclasses import dataclass
from typing import Deque, NamedTuple, Optional, Tuple

TWIST_WINDOW = 6
"""Readings over which the velocity is taken: one tick per reading would be 16 mm/s of noise, six make 3 mm/s."""

MAX_WHEEL_SPEED_M_S = 1.0
"""Faster than any servo of the robot: a larger step is a reset counter or garbage, not motion."""

RESET_TICKS = 5
"""A robot that has just booted stands: its counters are this close to zero (3 mm) when it is heard again."""

MAX_GAP_S = 10.0
"""Ticks of a pause without readings are believed as if the pause had at most this length."""

MAX_STEP_S = 1.0
"""Two readings further apart, or in the wrong order, say nothing about the velocity: the clock was set."""


@dataclass(frozen=True)
class WheelGeometry:
    """What turns ticks into metres."""

    wheel_diameter_m: float = 0.0492
    wheel_separation_m: float = 0.063
    ticks_per_turn: float = 288.0

    @property
    def tick_m(self) -> float:
        """Distance of the wheel's rim per tick."""
        return math.pi * self.wheel_diameter_m / self.ticks_per_turn


class Pose(NamedTuple):
    """A pose in frame hero_N/odom."""

    x_m: float
    y_m: float
    yaw_rad: float


class Twist(NamedTuple):
    """A velocity in frame hero_N/base_link."""

    linear_m_s: float
    turn_rad_s: float


class TickOdometry:
    """The odometry of one robot; one per robot, kept over its reconnects."""

    def __init__(self, geometry: WheelGeometry) -> None:
        self.pose = Pose(0.0, 0.0, 0.0)
        self.resets = 0
        self.has_reading = False
        self._tick_m = geometry.tick_m
        self._separation_m = geometry.wheel_separation_m
        self._ticks: Optional[Tuple[float, float]] = None
        self._stamp_s = 0.0
        self._window: Deque[Tuple[float, float, float]] = collections.deque(maxlen=TWIST_WINDOW)

    @property
    def twist(self) -> Twist:
        """The velocity over the last TWIST_WINDOW readings; zero while there are less than two."""
        if len(self._window) < 2:
            return Twist(0.0, 0.0)
        first_s, first_left, first_right = self._window[0]
        last_s, last_left, last_right = self._window[-1]
        speed = self._tick_m / (last_s - first_s)
        left_m_s, right_m_s = (last_left - first_left) * speed, (last_right - first_right) * speed
        return Twist((left_m_s + right_m_s) / 2.0, (right_m_s - left_m_s) / self._separation_m)

    def expect_reset(self) -> None:
        """The robot rebooted: its counters begin anew, the pose stays where it was."""
        self._ticks = None
        self._window.clear()

    def set_pose(self, pose: Pose) -> None:
        """The robot's odometry was set, which zeroes its counters (Odometry.ino:234)."""
        self.pose = pose
        self._ticks = (0.0, 0.0)
        self._window.clear()

    def looks_reset(self, left_ticks: float, right_ticks: float) -> bool:
        """Return whether counters that were away from zero are back there, as after a reboot."""
        if self._ticks is None:
            return False
        return (
            max(abs(left_ticks), abs(right_ticks)) <= RESET_TICKS
            and max(abs(self._ticks[0]), abs(self._ticks[1])) > 4 * RESET_TICKS
        )

    def integrate(self, left_ticks: float, right_ticks: float, stamp_s: float) -> None:
        """Take one reading of the counters (ticks since boot or set_odom, forward positive)."""
        if not (math.isfinite(left_ticks) and math.isfinite(right_ticks)):
            return
        self.has_reading = True
        last, self._ticks = self._ticks, (left_ticks, right_ticks)
        elapsed_s, self._stamp_s = stamp_s - self._stamp_s, stamp_s
        if last is None:
            self._window.clear()
            self._window.append((stamp_s, left_ticks, right_ticks))
            return
        left_m = (left_ticks - last[0]) * self._tick_m
        right_m = (right_ticks - last[1]) * self._tick_m
        limit_m = MAX_WHEEL_SPEED_M_S * min(max(elapsed_s, 0.2), MAX_GAP_S)
        if abs(left_m) > limit_m or abs(right_m) > limit_m:
            self.resets += 1
            self._window.clear()
        elif left_m or right_m:
            self._move(left_m, right_m)
        if not 0.0 < elapsed_s <= MAX_STEP_S:
            self._window.clear()
        self._window.append((stamp_s, left_ticks, right_ticks))

    def _move(self, left_m: float, right_m: float) -> None:
        """Follow the arc that two wheels describe which run left_m and right_m at steady speeds."""
        distance_m = (left_m + right_m) / 2.0
        turn_rad = (right_m - left_m) / self._separation_m
        x_m, y_m, yaw_rad = self.pose
        half_rad = turn_rad / 2.0
        # The chord of the arc: its length is distance * sin(half) / half, its direction yaw + half.
        chord_m = distance_m if abs(half_rad) < 1e-9 else distance_m * math.sin(half_rad) / half_rad
        self.pose = Pose(
            x_m + chord_m * math.cos(yaw_rad + half_rad),
            y_m + chord_m * math.sin(yaw_rad + half_rad),
            math.remainder(yaw_rad + turn_rad, 2.0 * math.pi),
        )
