"""Stigmergy: robots leave pheromone and turn away from it, so that they go where none was lately.

The mission is that of Grid exploration in automatic design: a grid of 10 x 10 cells, each as old as its last visit.
"""

import numpy as np

from hero_swarm.behavior import Behavior, Floor, Pheromone, Proximity

CELLS = 10


class Explore(Behavior):
    """Wanders away from pheromone, which every robot leaves, and keeps when each cell was visited last."""

    trail = Pheromone(half_life_s=40.0, cell_m=0.05, reach_m=0.12, angle_rad=0.8)
    eyes = Proximity()
    floor = Floor()
    rate_hz = 10
    linear_m_s = 0.1
    gain = 1.0
    side_m = 2.0

    def step(self, sensed, memory, random):
        worlds = len(sensed.numbers) // sensed.count
        visits_s = np.zeros((worlds, CELLS, CELLS)) if memory is None else memory["visits_s"].copy()
        cells = np.floor((sensed.poses[:, :2] / self.side_m + 0.5) * CELLS)
        columns, rows = np.clip(np.nan_to_num(cells), 0, CELLS - 1).astype(int).T
        visits_s[np.repeat(np.arange(worlds), sensed.count), rows, columns] = sensed.time_s
        trail, ranges_m = sensed.trail, sensed.eyes.ranges_m
        steep = (trail.left - trail.right) / (trail.left + trail.right + 0.1)
        is_blocked = (ranges_m[:, [7, 0, 1]] < 0.12).any(axis=1)
        side = np.where(ranges_m[:, 1] < ranges_m[:, 7], -1.0, 1.0)
        turn_rad_s = np.where(is_blocked, 2.5 * side, -self.gain * steep + 0.8 * random.normal())
        memory = {"visits_s": visits_s, "amounts": np.where(sensed.is_known, 1.0, 0.0)}
        return np.where(is_blocked, 0.0, self.linear_m_s), turn_rad_s, memory

    def deposits(self, memory):
        return memory["amounts"]


def age_s(state):
    """Return the mean age of all cells of each world, s."""
    return state.time_s - state.memory["visits_s"].mean(axis=(1, 2))
