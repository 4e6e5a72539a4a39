"""Wheel travel -> encoder values and odometry, in the way and with the losses of the stock firmware.

Pure. Source: WheelEncoder.ino and Odometry.ino as measured on the stock robot. The loss: whoever reads the
encoders overwrites the distances of the last interval, and odometry adds only the last interval. While the
velocity controller reads too (47 times a second), a third and more of the way is missed.
"""

import math
from typing import List, Tuple

from ..robot_constants import TICK_M, WHEEL_SEPARATION_M

FILTER_MEASURE_ERROR = 1.0
FILTER_FIRST_ERROR = 1.0
FILTER_PROCESS_NOISE_S_M = 10.0
"""Kalman filter in front of the speeds. Only the ratios count; they reproduce the decay of the speeds that
the stock robot sends after a stop to five digits."""


class _SpeedFilter:
    """A one-dimensional Kalman filter whose process noise grows with each change of its own estimate."""

    def __init__(self) -> None:
        self.value_m_s = 0.0
        self._error = FILTER_FIRST_ERROR

    def update(self, speed_m_s: float) -> float:
        gain = self._error / (self._error + FILTER_MEASURE_ERROR)
        change_m_s = gain * (speed_m_s - self.value_m_s)
        self.value_m_s += change_m_s
        self._error = (1.0 - gain) * self._error + abs(change_m_s) * FILTER_PROCESS_NOISE_S_M
        return self.value_m_s


class WheelOdometry:
    """Encoders and odometry of one robot.

    Attributes:
        pose: x m, y m, theta rad, as the robot believes.
        ticks: counts of the left and right wheel since the last set_pose(), as last read.
        filtered_m_s: speeds of the left and right wheel, behind the filter, as last read.
    """

    def __init__(self, exact: bool = False, left_m: float = 0.0, right_m: float = 0.0) -> None:
        """Count from wheel travels left_m and right_m on; with exact, no interval is missed (a robot with the
        firmware's fault repaired)."""
        self.pose = (0.0, 0.0, 0.0)
        self.ticks = (0, 0)
        self._exact = exact
        self._counted_ticks = (math.floor(left_m / TICK_M), math.floor(right_m / TICK_M))
        self._base_ticks = self._counted_ticks
        self._integrated_ticks = (0, 0)
        self._diff_ticks = (0, 0)
        self._read_at_us = 0
        self._timestep_s = 0.0
        self._speeds_m_s = (0.0, 0.0)
        self._filters = (_SpeedFilter(), _SpeedFilter())
        self.filtered_m_s = (0.0, 0.0)

    def read_encoders(self, now_us: int, left_m: float, right_m: float) -> None:
        """Take over the wheels' travel (m) at now_us of the robot's own clock; overwrites the last
        interval."""
        left = math.floor(left_m / TICK_M)
        right = math.floor(right_m / TICK_M)
        self._counted_ticks = (left, right)
        ticks = (left - self._base_ticks[0], right - self._base_ticks[1])
        self._diff_ticks = (ticks[0] - self.ticks[0], ticks[1] - self.ticks[1])
        self.ticks = ticks
        self._timestep_s = (now_us - self._read_at_us) / 1e6
        self._read_at_us = now_us
        if self._timestep_s > 0.0:
            left_m_s = self._diff_ticks[0] * TICK_M / self._timestep_s
            right_m_s = self._diff_ticks[1] * TICK_M / self._timestep_s
            self._speeds_m_s = (left_m_s, right_m_s)
            self.filtered_m_s = (self._filters[0].update(left_m_s), self._filters[1].update(right_m_s))

    def count_ticks(self, left_m: float, right_m: float) -> List[int]:
        """Return what the counters show at these travels (m), without reading the encoders for a message."""
        return [
            math.floor(left_m / TICK_M) - self._base_ticks[0],
            math.floor(right_m / TICK_M) - self._base_ticks[1],
        ]

    def integrate(self) -> None:
        """Add the last interval to the pose."""
        if self._exact:
            steps = (self.ticks[0] - self._integrated_ticks[0], self.ticks[1] - self._integrated_ticks[1])
            self._integrated_ticks = self.ticks
        else:
            steps = self._diff_ticks
        if steps == (0, 0):
            return
        left_m, right_m = steps[0] * TICK_M, steps[1] * TICK_M
        travel_m, turn_rad = (left_m + right_m) / 2.0, (right_m - left_m) / WHEEL_SEPARATION_M
        x_m, y_m, theta_rad = self.pose
        heading_rad = theta_rad + turn_rad / 2.0
        theta_rad = math.remainder(theta_rad + turn_rad, 2.0 * math.pi)
        self.pose = (
            x_m + travel_m * math.cos(heading_rad),
            y_m + travel_m * math.sin(heading_rad),
            theta_rad,
        )

    def set_pose(self, x_m: float, y_m: float, theta_rad: float) -> None:
        """Begin anew at this pose; the tick counters go to zero (Odometry.ino:234)."""
        self.pose = (x_m, y_m, theta_rad)
        self._base_ticks = self._counted_ticks
        self.ticks = self._diff_ticks = self._integrated_ticks = (0, 0)

    def set_heading(self, theta_rad: float) -> None:
        """Overrule the heading, as the robot does when it has an IMU."""
        self.pose = (self.pose[0], self.pose[1], theta_rad)

    @property
    def twist(self) -> Tuple[float, float]:
        """Filtered speed (m/s) and turn rate (rad/s)."""
        left_m_s, right_m_s = self.filtered_m_s
        return (left_m_s + right_m_s) / 2.0, (right_m_s - left_m_s) / WHEEL_SEPARATION_M

    def list_encoder_values(self) -> List[float]:
        """Return the eleven values of an Encoder message, in the order of its fields."""
        left, right = self._diff_ticks
        return [
            float(self.ticks[0]),
            float(self.ticks[1]),
            float(left),
            float(right),
            left * TICK_M,
            right * TICK_M,
            self._timestep_s,
            *self._speeds_m_s,
            *self.filtered_m_s,
        ]
