"""Decisions of a swarm, shown by its lights: robots wander and take opinions over from those they meet."""

from typing import Any

import numpy as np

from hero_node.parameters import number

from ..behavior import SPEED, Behavior, Command, Neighbors, Proximity, Random, Sensed


class Voter(Behavior):
    """A robot takes over the opinion of a neighbor drawn by lot (G. Valentini et al., AAMAS 2014, without qualities).

    The memory is the opinion of each robot, 0 or 1: at first that of the first half of the robots is 0. Robots turn
    away from what their infrared sensors see ahead.
    """

    near = Neighbors(range_m=0.5)
    infrared = Proximity()
    metric = "nearest_neighbor"
    rate_hz = 2.0
    changes_hz = 0.5  # how often a robot looks at the others
    cruise_m_s = 0.1
    angular_rad_s = 1.5
    clear_m = 0.16
    settings = {"changes_hz": number(0.5, 0.01, 10.0, "1/s"), "cruise_m_s": SPEED}

    def step(self, sensed: Sensed, memory: Any, random: Random) -> Command:
        near = sensed.near
        opinions = (sensed.numbers >= sensed.count // 2).astype(int) if memory is None else memory
        looks = (random.random() < self.changes_hz / self.rate_hz) & (near.counts > 0)
        decided = self.decide(opinions, near, random)
        opinions = np.where(looks, decided, opinions)
        # Front, and 45 degrees to its left and right.
        blocked = np.nan_to_num(sensed.infrared.ranges_m[:, (0, 1, -1)], nan=np.inf).min(axis=1) < self.clear_m
        angular_rad_s = np.where(blocked, self.angular_rad_s, self.angular_rad_s * random.normal())
        return np.where(blocked, 0.0, self.cruise_m_s), angular_rad_s, opinions

    def decide(self, opinions: np.ndarray, near: Any, random: Random) -> np.ndarray:
        """Return the opinion that each robot would take over (R,)."""
        chosen = np.where(near.seen, random.random(near.seen.shape[1]), -1.0).argmax(axis=1)
        taken: np.ndarray = opinions[near.rows[np.arange(len(opinions)), chosen]]
        return taken

    def colors(self, memory: Any) -> np.ndarray:
        """Red for 0, blue for 1."""
        return np.column_stack((memory == 0, np.zeros(len(memory)), memory == 1)).astype(float)


class Majority(Voter):
    """A robot takes over what most of its neighbors and itself say; a tie changes nothing (Galam 2002)."""

    def decide(self, opinions: np.ndarray, near: Any, random: Random) -> np.ndarray:
        for_one = (opinions[near.rows] * near.seen).sum(axis=1) + opinions
        voters = near.counts + 1
        return np.where(2 * for_one == voters, opinions, (2 * for_one > voters).astype(int))
