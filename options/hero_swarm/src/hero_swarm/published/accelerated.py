"""Segregation as rezeck/segregation computes it: robots are accelerated by potentials, and damped by the others."""

from typing import Any

import numpy as np

from hero_client.controllers import steer
from hero_swarm.behavior import Command, Random, Sensed, turn
from hero_swarm.behaviors.spacing import PotentialSegregation


class Accelerated(PotentialSegregation):
    """Points with the accelerations of V. Santos et al., Swarm Intelligence 2020; all lengths in m.

    The memory holds of each robot its velocity, its acceleration and its group.

    Attributes:
        noise: largest error of squared distances in 99.7 % of cases, as a share of them.
    """

    rate_hz = 100.0
    unit_m, own_m, others_m = 1.0, 2.0, 5.0
    max_linear_m_s, max_angular_rad_s = 1e3, 1e5
    noise = 0.0

    def step(self, sensed: Sensed, memory: Any, random: Random) -> Command:
        near, group = sensed.near, sensed.numbers % int(self.groups)
        rest_m = np.where(group[near.rows] == group[:, None], self.own_m, self.others_m)
        errors = 1.0 + self.noise / 3.0 * random.normal(near.seen.shape[1])
        square_m2 = np.where(near.seen, near.range_m**2, 1.0) * errors
        range_m = np.sqrt(square_m2)
        pull_1_s2 = (range_m - rest_m + 1.0 / range_m - rest_m / square_m2) * near.seen / range_m
        velocity = np.zeros((2, len(group))) if memory is None else memory[:, :2].T
        force = np.array([(pull_1_s2 * part).sum(axis=1) for part in (near.forward_m, near.left_m)])
        of_worlds = velocity.reshape(2, -1, sensed.count).sum(axis=2)
        damping = np.repeat(of_worlds, sensed.count, axis=1) - sensed.count * velocity
        acceleration = turn(force, sensed.poses[:, 2]) + damping
        driven = turn(velocity + 0.5 * acceleration / self.rate_hz, -sensed.poses[:, 2])
        velocity = velocity + acceleration / self.rate_hz
        speeds = steer(driven[0], driven[1], self.max_linear_m_s, max_angular_rad_s=self.max_angular_rad_s)
        return (*speeds, np.column_stack((*velocity, *acceleration, group)))
