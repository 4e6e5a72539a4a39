"""Encoder values and odometry from wheel travel, with the losses of the stock firmware.

Pure. Source: WheelEncoder.ino and Odometry.ino as measured on the stock robot. The loss: every reading of the
encoders overwrites the distances of the last interval, and odometry adds only the last interval. While the
velocity controller reads too (47 times a second), a third and more of the path is missed.
"""

import math
from typing import List, Tuple

from hero_node import Pose
from hero_node.robot_constants import TICK_M

from ..world.kinematics import join_wheels

FILTER_FIRST_ERROR = 1.0
FILTER_PROCESS_NOISE_S_M = 10.0
"""Kalman filter in front of the speeds, with errors in units of a measurement's. They reproduce to five digits the
decay of the speeds that the stock robot sends after a stop."""


class _SpeedFilter:
    """A one-dimensional Kalman filter whose process noise grows with each change of its own estimate."""

    def __init__(self) -> None:
        self.value_m_s = 0.0
        self._error = FILTER_FIRST_ERROR

    def update(self, speed_m_s: float) -> float:
        gain = self._error / (self._error + 1.0)
        change_m_s = gain * (speed_m_s - self.value_m_s)
        self.value_m_s += change_m_s
        self._error = abs(change_m_s) * FILTER_PROCESS_NOISE_S_M + gain
        return self.value_m_s


class WheelOdometry:
    """Encoders and odometry of one robot.

    Attributes:
        tick_m: travel per tick.
        pose: what the robot takes for its pose.
        ticks: counts of the left and right wheel since the last set_pose(), as last read.
        filtered_m_s: speeds of the left and right wheel, behind the filter, as last read.
    """

    def __init__(self, left_m: float, right_m: float, tick_m: float = TICK_M) -> None:
        """Count from wheel travels left_m and right_m on; tick_m: travel per tick."""
        self.tick_m = tick_m
        self.pose = Pose(0.0, 0.0, 0.0)
        self.ticks = (0, 0)
        self.filtered_m_s = (0.0, 0.0)
        self._base_ticks = (math.floor(left_m / tick_m), math.floor(right_m / tick_m))
        self._diff_ticks = (0, 0)
        self._read_at_us = 0
        self._timestep_s = 0.0
        self._speeds_m_s = (0.0, 0.0)
        self._filters = (_SpeedFilter(), _SpeedFilter())

    def read_encoders(self, now_us: int, left_m: float, right_m: float) -> None:
        """Take the wheels' travel (m) at now_us of the robot's own clock; overwrites the last interval."""
        left, right = self.count_ticks(left_m, right_m)
        self._diff_ticks = (left - self.ticks[0], right - self.ticks[1])
        self.ticks = (left, right)
        self._timestep_s = (now_us - self._read_at_us) / 1e6
        self._read_at_us = now_us
        if self._timestep_s > 0.0:
            left_m_s = self._diff_ticks[0] * self.tick_m / self._timestep_s
            right_m_s = self._diff_ticks[1] * self.tick_m / self._timestep_s
            self._speeds_m_s = (left_m_s, right_m_s)
            self.filtered_m_s = (self._filters[0].update(left_m_s), self._filters[1].update(right_m_s))

    def count_ticks(self, left_m: float, right_m: float) -> List[int]:
        """Return the counters at these travels (m), without reading the encoders for a message."""
        left_base, right_base = self._base_ticks
        return [math.floor(left_m / self.tick_m) - left_base, math.floor(right_m / self.tick_m) - right_base]

    def integrate(self) -> None:
        """Add the last interval to the pose."""
        left, right = self._diff_ticks
        if left == right == 0:
            return
        travel_m, rotation_rad = join_wheels(left * self.tick_m, right * self.tick_m)
        x_m, y_m, yaw_rad = self.pose
        heading_rad = yaw_rad + rotation_rad / 2.0
        self.pose = Pose(
            x_m + travel_m * math.cos(heading_rad),
            y_m + travel_m * math.sin(heading_rad),
            math.remainder(yaw_rad + rotation_rad, 2.0 * math.pi),
        )

    def set_pose(self, pose: Pose) -> None:
        """Begin anew at this pose; the tick counters go to zero (Odometry.ino:234)."""
        self.pose = pose
        self._base_ticks = (self._base_ticks[0] + self.ticks[0], self._base_ticks[1] + self.ticks[1])
        self.ticks = self._diff_ticks = (0, 0)

    def set_heading(self, yaw_rad: float) -> None:
        """Overrule the heading, as the robot does when it has an IMU."""
        self.pose = Pose(self.pose.x_m, self.pose.y_m, yaw_rad)

    @property
    def twist(self) -> Tuple[float, float]:
        """Filtered linear (m/s) and angular speed (rad/s)."""
        linear_m_s, angular_rad_s = join_wheels(*self.filtered_m_s)
        return linear_m_s, angular_rad_s

    def list_encoder_values(self) -> Tuple[float, ...]:
        """Return the eleven values of an Encoder message, in the order of its fields."""
        left, right = self._diff_ticks
        travels_m = (left * self.tick_m, right * self.tick_m)
        return (*self.ticks, left, right, *travels_m, self._timestep_s, *self._speeds_m_s, *self.filtered_m_s)
