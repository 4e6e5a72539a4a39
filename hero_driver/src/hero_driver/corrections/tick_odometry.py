"""Differential-drive odometry from wheel ticks, on exact arcs. Pure: ticks and stamps in, pose and twist out (REP 103).

The firmware's own integration loses a third and more of the distance while the velocity controller drives
(VelocityControl.ino:112 overwrites what Odometry.ino:130 has not read yet); its tick counters stay right.
"""

import collections
import math
from dataclasses import dataclass
from typing import Deque, Optional, Tuple

from hero_node import Pose
from hero_node.robot_constants import MODELS, TICKS_PER_TURN, WHEEL_DIAMETER_M, WHEEL_SEPARATION_M

MAX_WHEEL_SPEED_M_S = 1.0
"""Faster than any servo of the robot."""

TWIST_WINDOW = 6
"""Readings over which the velocity is taken: one tick per reading would be 16 mm/s of noise, six make 3 mm/s."""

RESET_TICKS = 5
"""A robot that has just booted is at rest: its counters are this close to zero (3 mm) when it sends again."""

MIN_GAP_S = 0.2
"""Ticks over this time are believed however close two stamps are: the robot's clock may be set back between them."""

MAX_GAP_S = 10.0
"""Ticks of a pause without readings are believed as if the pause had at most this length."""

MAX_STEP_S = 1.0
"""Two readings further apart, or in the wrong order, say nothing about the velocity: the clock was set."""


@dataclass(frozen=True)
class WheelGeometry:
    """Conversion of ticks into meters."""

    wheel_diameter_m: float = WHEEL_DIAMETER_M
    """Mean of both wheels."""
    wheel_separation_m: float = WHEEL_SEPARATION_M
    ticks_per_turn: float = TICKS_PER_TURN
    diameter_ratio: float = 1.0
    """The right wheel's to the left wheel's."""

    @property
    def ticks_m(self) -> Tuple[float, float]:
        """Distances of the left and the right wheel's rim per tick."""
        left_m = math.pi * self.wheel_diameter_m / self.ticks_per_turn * 2.0 / (1.0 + self.diameter_ratio)
        return left_m, left_m * self.diameter_ratio


_PLUS = MODELS["hero_plus"]
PLUS_WHEELS = WheelGeometry(_PLUS.wheel_diameter_m, _PLUS.wheel_separation_m, TICKS_PER_TURN / 3.0)
"""HeRo+'s; the firmware's config.h divides the circumference by 96."""


class TickOdometry:
    """The odometry of one robot, kept over its reconnects: pose in hero_N/odom, velocity in hero_N/base_link.

    Attributes:
        linear_m_s, angular_rad_s: over the last TWIST_WINDOW readings; zero while there are less than two.
        has_reading: whether there was one ever.
        resets: steps that were too large for a robot's motion.
        fault: what was wrong with the newest reading that was not believed, with a remedy, for users.
    """

    def __init__(self, geometry: WheelGeometry) -> None:
        """Begin at zero, at rest, with wheels of this geometry."""
        self.x_m = self.y_m = self.yaw_rad = 0.0
        self.linear_m_s = self.angular_rad_s = 0.0
        self.resets = 0
        self.fault = ""
        self.has_reading = False
        self.change_wheels(geometry)
        self._ticks: Optional[Tuple[float, float]] = None
        self._stamp_s = 0.0
        self._window: Deque[Tuple[float, float, float]] = collections.deque(maxlen=TWIST_WINDOW)

    def change_wheels(self, geometry: WheelGeometry) -> None:
        """Measure with other wheels from now on."""
        self._left_tick_m, self._right_tick_m = geometry.ticks_m
        self._separation_m = geometry.wheel_separation_m

    def expect_reset(self) -> None:
        """The robot rebooted: its counters begin anew, the pose stays where it was."""
        self._ticks = None
        self._forget_velocity()

    def set_pose(self, pose: Pose) -> None:
        """The robot's odometry was set, which zeroes its counters (Odometry.ino:234)."""
        self.x_m, self.y_m, self.yaw_rad = pose
        self._ticks = (0.0, 0.0)
        self._forget_velocity()

    def looks_reset(self, left_ticks: float, right_ticks: float) -> bool:
        """Return whether counters that were away from zero are back there, as after a reboot."""
        if self._ticks is None:
            return False
        return (
            max(abs(left_ticks), abs(right_ticks)) <= RESET_TICKS
            and max(abs(self._ticks[0]), abs(self._ticks[1])) > 4 * RESET_TICKS
        )

    def integrate(self, left_ticks: float, right_ticks: float, stamp_s: float) -> bool:
        """Take a reading of the counters (ticks since boot or set_odom); return whether the pose is another one now."""
        # A sum of the two is finite only if both are.
        if not math.isfinite(left_ticks + right_ticks):
            text = "encoder counts %g and %g ticks, which odometry ignores: reboot the robot"
            self.fault = text % (left_ticks, right_ticks)
            return False
        self.has_reading = True
        last, self._ticks = self._ticks, (left_ticks, right_ticks)
        elapsed_s = stamp_s - self._stamp_s
        self._stamp_s = stamp_s
        if last is None:
            self._window.append((stamp_s, left_ticks, right_ticks))
            return False
        left_m = (left_ticks - last[0]) * self._left_tick_m
        right_m = (right_ticks - last[1]) * self._right_tick_m
        is_moving = left_m != 0.0 or right_m != 0.0
        if is_moving:
            # min() and max() would cost as much as all else here.
            gap_s = MIN_GAP_S if elapsed_s <= MIN_GAP_S else MAX_GAP_S if elapsed_s >= MAX_GAP_S else elapsed_s
            limit_m = MAX_WHEEL_SPEED_M_S * gap_s
            # A larger step is a reset counter or garbage, not motion.
            if -limit_m <= left_m <= limit_m and -limit_m <= right_m <= limit_m:
                self._move(left_m, right_m)
            else:
                self.resets += 1
                text = "encoder jumped by %g and %g ticks, which odometry ignores: check where the robot is, and the"
                text += " encoders' wires if it happens again"
                self.fault = text % (left_ticks - last[0], right_ticks - last[1])
                self._forget_velocity()
                is_moving = False
        if not 0.0 < elapsed_s <= MAX_STEP_S:
            self._forget_velocity()
        self._window.append((stamp_s, left_ticks, right_ticks))
        first_s, first_left, first_right = self._window[0]
        if first_s != stamp_s:
            left_m_s = (left_ticks - first_left) * self._left_tick_m / (stamp_s - first_s)
            right_m_s = (right_ticks - first_right) * self._right_tick_m / (stamp_s - first_s)
            # Stamps that lie too close together say nothing about the velocity.
            if (
                -MAX_WHEEL_SPEED_M_S <= left_m_s <= MAX_WHEEL_SPEED_M_S
                and -MAX_WHEEL_SPEED_M_S <= right_m_s <= MAX_WHEEL_SPEED_M_S
            ):
                self.linear_m_s = (left_m_s + right_m_s) / 2.0
                self.angular_rad_s = (right_m_s - left_m_s) / self._separation_m
        return is_moving

    def _forget_velocity(self) -> None:
        self._window.clear()
        self.linear_m_s = self.angular_rad_s = 0.0

    def _move(self, left_m: float, right_m: float) -> None:
        """Follow the arc that two wheels describe which run left_m and right_m at steady speeds."""
        distance_m = (left_m + right_m) / 2.0
        angle_rad = (right_m - left_m) / self._separation_m
        half_rad = angle_rad / 2.0
        # The chord of the arc: its length is distance * sin(half) / half, its direction yaw + half.
        chord_m = distance_m * (math.sin(half_rad) / half_rad) if half_rad else distance_m
        direction_rad = self.yaw_rad + half_rad
        self.x_m += chord_m * math.cos(direction_rad)
        self.y_m += chord_m * math.sin(direction_rad)
        self.yaw_rad = math.remainder(self.yaw_rad + angle_rad, 2.0 * math.pi)
