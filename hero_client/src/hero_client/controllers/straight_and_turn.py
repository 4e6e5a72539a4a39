"""Drives a robot straight on by a distance, or turns it on the spot by an angle, measured by its odometry. Pure."""

import math
from typing import Optional, Sequence

from hero_node import Pose, Velocity, clamp, invert_pose, transform_pose, wrap_angle

from .motion import MotionController

TOLERANCE_M = 0.005
TOLERANCE_RAD = 0.03

LINEAR_GAIN = 0.8
"""Speed in m/s per meter that is left, 1/s."""

ANGULAR_GAIN = 1.5
"""Turn in rad/s per radian that is left, 1/s."""

MIN_LINEAR_M_S = 0.02
MIN_ANGULAR_RAD_S = 0.2
"""Slower than this the end would take long, and motors may not start."""


class ForwardController(MotionController):
    """Drives by a distance on the heading that the robot has at the first pose, backwards if it is negative."""

    def __init__(self, length_m: float, now_s: float, linear_m_s: float) -> None:
        """linear_m_s: the speed, also positive when driving backwards."""
        super().__init__(now_s)
        self._length_m = length_m
        self._linear_m_s = linear_m_s
        self._start: Optional[Pose] = None
        self._driven = Pose(0.0, 0.0, 0.0)  # as seen from the start
        self._remaining_m = length_m

    def _offset(self, pose: Pose) -> float:
        self._start = self._start or pose
        self._driven = transform_pose(invert_pose(self._start), pose)
        self._remaining_m = self._length_m - self._driven.x_m
        self.distance_m = abs(self._remaining_m)
        return self.distance_m / TOLERANCE_M

    def _approach(self, pose: Pose, ranges: Sequence[float], seen_s: float) -> Velocity:
        speed_m_s = min(self._linear_m_s, max(MIN_LINEAR_M_S, LINEAR_GAIN * self.distance_m))
        angular_rad_s = clamp(-ANGULAR_GAIN * self._driven.yaw_rad, 1.0)
        return Velocity(math.copysign(speed_m_s, self._remaining_m), angular_rad_s)


class TurnController(MotionController):
    """Turns by an angle, which may be more than a full turn."""

    def __init__(self, angle_rad: float, now_s: float, angular_rad_s: float) -> None:
        """angular_rad_s: the speed, also positive when turning to the right."""
        super().__init__(now_s)
        self._remaining_rad = angle_rad
        self._angular_rad_s = angular_rad_s
        self._last_yaw_rad: Optional[float] = None

    def _offset(self, pose: Pose) -> float:
        if self._last_yaw_rad is not None:
            self._remaining_rad -= wrap_angle(pose.yaw_rad - self._last_yaw_rad)
        self._last_yaw_rad = pose.yaw_rad
        return abs(self._remaining_rad) / TOLERANCE_RAD

    def _approach(self, pose: Pose, ranges: Sequence[float], seen_s: float) -> Velocity:
        speed_rad_s = min(self._angular_rad_s, max(MIN_ANGULAR_RAD_S, ANGULAR_GAIN * abs(self._remaining_rad)))
        return Velocity(0.0, math.copysign(speed_rad_s, self._remaining_rad))

    def _describe_distance(self) -> str:
        return f", {abs(self._remaining_rad):.2f} rad are left"
