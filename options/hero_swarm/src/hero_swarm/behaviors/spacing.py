"""Behaviors by forces between neighbors: dispersion and segregation."""

from typing import Any

import numpy as np

from hero_client.controllers import steer
from hero_node.parameters import whole_number

from ..behavior import GAIN, RANGE, SPEED, Behavior, Command, Neighborhood, Neighbors, Random, Sensed
from .clearance import keep_apart


class Dispersion(Behavior):
    """Robots repel each other until all are spacing_m apart (A. Howard et al., DARS 2002)."""

    near = Neighbors(range_m=1.0)
    metric = "nearest_neighbor"
    spacing_m = 0.5
    gain_1_s = 0.4
    max_linear_m_s = 0.1
    settings = {"spacing_m": RANGE, "gain_1_s": GAIN, "max_linear_m_s": SPEED}

    def step(self, sensed: Sensed, memory: Any, random: Random) -> Command:
        forward_m_s, left_m_s = keep_apart(sensed.near, self.spacing_m, self.gain_1_s)
        return (*steer(forward_m_s, left_m_s, self.max_linear_m_s), memory)


class Segregation(Behavior):
    """Robots gather with those of their own group, and keep away from the others.

    Differential potential (M. Kumar, D. Garg, V. Kumar, Segregation of heterogeneous units in a swarm of robotic
    agents, IEEE TAC 2010): the distance at rest is own_m in a group and others_m between groups. A robot's group is its
    number modulo groups; it shows it by its light.
    """

    near = Neighbors()
    metric = "algebraic_connectivity"
    groups = 2
    own_m = 0.15
    others_m = 1.0
    gain_1_s = 0.1
    wander_m_s = 0.03
    max_linear_m_s = 0.1
    max_angular_rad_s = 2.5
    settings = {"groups": whole_number(2, 2, 6), "own_m": RANGE, "others_m": RANGE, "max_linear_m_s": SPEED}

    def step(self, sensed: Sensed, memory: Any, random: Random) -> Command:
        """The memory is the group of each robot."""
        near, group = sensed.near, sensed.numbers % int(self.groups)
        range_m = np.maximum(near.range_m, 1e-6)
        is_own = group[near.rows] == group[:, None]
        share = self.find_pull(near, range_m, is_own) * near.seen / range_m
        forward_m_s = (share * near.forward_m).sum(axis=1) + self.wander_m_s * random.normal()
        left_m_s = (share * near.left_m).sum(axis=1) + self.wander_m_s * random.normal()
        return (*steer(forward_m_s, left_m_s, self.max_linear_m_s, max_angular_rad_s=self.max_angular_rad_s), group)

    def find_pull(self, near: Neighborhood, range_m: np.ndarray, is_own: np.ndarray) -> np.ndarray:
        """Return the speed (m/s) towards each neighbor (R, N), of the same group where is_own."""
        off_m = range_m - np.where(is_own, self.own_m, self.others_m)
        scale = 4.0 * self.gain_1_s / np.maximum(near.counts, 1) ** 0.5
        pull_m_s: np.ndarray = scale[:, None] * np.where(is_own, off_m, np.minimum(off_m, 0.0))
        return pull_m_s

    def colors(self, memory: Any) -> np.ndarray:
        palette = np.array([(1, 0, 0), (0, 0, 1), (0, 1, 0), (1, 1, 0), (1, 0, 1), (0, 1, 1)], dtype=float)
        group = np.reshape(memory, (len(memory), -1))[:, -1].astype(int)  # alone, or last
        shown: np.ndarray = palette[group % len(palette)]
        return shown


class PotentialSegregation(Segregation):
    """Robots take the distance own_m in their group, and others_m from other groups, by a potential that is convex.

    After V. Santos et al., Spatial segregative behaviors in robotic swarms using differential potentials, Swarm
    Intelligence 2020. Its robots are accelerated by the forces of all neighbors and damped by the velocities of all;
    ours take at once the velocities at which these balance.
    """

    unit_m = 0.1  # of the potential's lengths
    own_m, others_m = 0.2, 1.0
    gain_1_s = 1.0
    wander_m_s = 0.0

    def find_pull(self, near: Neighborhood, range_m: np.ndarray, is_own: np.ndarray) -> np.ndarray:
        apart, rest = range_m / self.unit_m, np.where(is_own, self.own_m, self.others_m) / self.unit_m
        force = (apart - rest) * (1.0 + apart**-2)
        pull_m_s: np.ndarray = self.gain_1_s * self.unit_m * force / near.seen.shape[1]
        return pull_m_s
