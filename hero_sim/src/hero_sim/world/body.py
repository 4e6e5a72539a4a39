"""The hardware of one robot, as its firmware sees it: one row of the world's arrays.

Pure: time is the world's, ms.
"""

import math
from typing import List

import numpy as np

from .kinematics import Pose, find_frame, join_wheels
from .robot_errors import MAX_WHEEL_M_S, SERVO_GAIN_M_S_US
from .world import World

__all__ = ["Body"]


class Body:
    """One robot's wheels, servos, infrared sensors and place.

    Attributes:
        index: its row in the world.
        odom_origin: true pose of the robot's odom frame, since its odometry was last set. A restart of the
            firmware does not change it: odometry continues where it was.
    """

    def __init__(self, world: World, index: int) -> None:
        """Be the robot at index of world."""
        self._world = world
        self.index = index
        self.odom_origin = self.true_pose

    @property
    def true_pose(self) -> Pose:
        """Where the robot is in the world."""
        return Pose(*self._world.poses[self.index].tolist())

    @property
    def travels_m(self) -> List[float]:
        """The travel of the left and right wheel at the end of the last step."""
        return self._world.wheel_rows[self.index][:2]

    @property
    def angular_rad_s(self) -> float:
        """How fast the robot turns, as its wheels have it."""
        _, angular_rad_s = join_wheels(*self._world.speeds_m_s[self.index].tolist())
        return float(angular_rad_s)

    def set_odometry(self, pose: Pose) -> None:
        """Place the odom frame where the robot's odometry is now pose."""
        self.odom_origin = find_frame(self.true_pose, pose)

    def read_wheels(self, time_ms: int) -> List[float]:
        """Return the travel (m) of the left and right wheel, at a time within the running step."""
        left_m, right_m, left_m_s, right_m_s = self._world.wheel_rows[self.index]
        since_step_s = (time_ms - self._world.time_ms) / 1000.0
        return [left_m + left_m_s * since_step_s, right_m + right_m_s * since_step_s]

    def read_infrared(self) -> np.ndarray:
        """Return one noisy reading (whole counts, 0..1023) of the eight sensors."""
        return self._world.read_infrared(np.array([self.index]))[0]

    def write_pulses(self, left_us: int, right_us: int) -> None:
        """Set the servos' pulses; below its center the left wheel rolls forward."""
        errors, index = self._world.errors, self.index
        left_center_us, right_center_us = errors.servo_center_us[index].tolist()
        dead_zone_us = float(errors.dead_zone_us[index, 0])
        left_gain, right_gain = errors.servo_gain[index].tolist()
        self._world.commands_m_s[index] = (
            _convert_pulse(left_center_us - left_us, dead_zone_us, left_gain),
            _convert_pulse(right_us - right_center_us, dead_zone_us, right_gain),
        )

    def release(self) -> None:
        """Stop the pulses: the wheels come to rest."""
        self._world.commands_m_s[self.index] = 0.0


def _convert_pulse(beyond_us: float, dead_zone_us: float, gain: float) -> float:
    """Return the wheel speed (m/s) of a servo whose pulse lies so far beyond its center, forward positive."""
    driven_us = max(abs(beyond_us) - dead_zone_us, 0.0)
    return math.copysign(min(driven_us * SERVO_GAIN_M_S_US * gain, MAX_WHEEL_M_S), beyond_us)
