"""A controller and its baseline: robots that drive to the middle of those in sight, and robots that wander."""

import numpy as np

from hero_swarm.behavior import Behavior, Neighbors, Proximity


class Gather(Behavior):
    """Drives to the middle of the neighbors in sight; alone, it wanders."""

    near = Neighbors(range_m=1.0)
    rate_hz = 10
    linear_m_s = 0.08

    def step(self, sensed, memory, random):
        near = sensed.near
        bearing_rad = np.arctan2(near.average(near.left_m), near.average(near.forward_m))
        is_alone = near.counts == 0
        turn_rad_s = np.where(is_alone, 1.0 * random.normal(), 2.0 * bearing_rad)
        return self.linear_m_s * np.cos(bearing_rad), turn_rad_s, memory


class Wander(Behavior):
    """Wanders, and turns away from what is in its way."""

    eyes = Proximity()
    rate_hz = 10
    linear_m_s = 0.08

    def step(self, sensed, memory, random):
        is_blocked = (sensed.eyes.ranges_m[:, [7, 0, 1]] < 0.12).any(axis=1)
        return np.where(is_blocked, 0.0, self.linear_m_s), np.where(is_blocked, 2.5, random.normal()), memory
