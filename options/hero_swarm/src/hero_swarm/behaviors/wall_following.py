"""Wall following by the infrared sensors, without contact."""

from typing import Any

import numpy as np

from ..behavior import RANGE, SPEED, Behavior, Command, Proximity, Random, Sensed

MAX_WALL_M = 0.25
"""Largest range of an infrared sensor that is one (see docs/robot_interface.md)."""


class WallFollowing(Behavior):
    """Robots follow walls on their right at wall_m, and turn left before what is ahead.

    After P. van Turennout et al., Wall-following control of a mobile robot, ICRA 1992.
    """

    infrared = Proximity()
    metric = "wall_following"
    rate_hz = 10.0
    wall_m = 0.08  # from the center
    clear_m = 0.12  # ahead
    linear_m_s = 0.07
    turn_rad_s = 1.2
    gain_rad_m_s = 10.0
    settings = {"linear_m_s": SPEED, "wall_m": RANGE}

    def step(self, sensed: Sensed, memory: Any, random: Random) -> Command:
        ranges_m = np.fmin(sensed.infrared.ranges_m, MAX_WALL_M)  # nan: not known
        front, front_left, _, _, _, _, right, front_right = ranges_m.T
        blocked = (front < self.clear_m) | (front_left < self.wall_m) | (front_right < self.wall_m)
        off_m = (np.sqrt(2.0) * self.wall_m - front_right) + (self.wall_m - right)
        turn = np.clip(self.gain_rad_m_s * off_m, -self.turn_rad_s, self.turn_rad_s)
        # What one of the two sees alone is a robot, or the end of a wall.
        has_wall = (right < MAX_WALL_M) & (front_right < MAX_WALL_M)
        angular_rad_s = np.where(blocked, self.turn_rad_s, np.where(has_wall, turn, 0.0))
        return np.where(blocked, 0.0, self.linear_m_s), angular_rad_s, memory
