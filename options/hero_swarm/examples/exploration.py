"""Stigmergy: robots leave pheromone and turn away from it, so that they go where none was lately."""

import numpy as np

from hero_swarm.behavior import Behavior, Floor, Pheromone, Proximity


class Explore(Behavior):
    """Wanders away from pheromone, which every robot leaves."""

    trail = Pheromone(half_life_s=40.0, cell_m=0.05, reach_m=0.12, angle_rad=0.8)
    eyes = Proximity()
    floor = Floor()
    rate_hz = 10
    linear_m_s = 0.1
    gain = 1.0

    def step(self, sensed, memory, random):
        trail, ranges_m = sensed.trail, sensed.eyes.ranges_m
        steep = (trail.left - trail.right) / (trail.left + trail.right + 0.1)
        is_blocked = (ranges_m[:, [7, 0, 1]] < 0.12).any(axis=1)
        side = np.where(ranges_m[:, 1] < ranges_m[:, 7], -1.0, 1.0)
        turn_rad_s = np.where(is_blocked, 2.5 * side, -self.gain * steep + 0.8 * random.normal())
        return np.where(is_blocked, 0.0, self.linear_m_s), turn_rad_s, np.where(sensed.is_known, 1.0, 0.0)

    def deposits(self, memory):
        return memory
