"""Behaviors by agreement with neighbors: rendezvous, leader and followers, formation by distances."""

from typing import Any

import numpy as np

from hero_client.controllers import steer

from ..behavior import GAIN, RANGE, SPEED, Behavior, Command, Neighbors, Random, Sensed
from .circling import find_angles_ahead
from .clearance import keep_apart


class Rendezvous(Behavior):
    """Robots meet: each drives to the mean place of its neighbors (Olfati-Saber, Fax, Murray, Proc. IEEE 2007)."""

    near = Neighbors(range_m=2.0)
    metric = "consensus_error"
    gain_1_s = 0.5
    max_linear_m_s = 0.1
    settings = {"gain_1_s": GAIN, "max_linear_m_s": SPEED}

    def step(self, sensed: Sensed, memory: Any, random: Random) -> Command:
        near = sensed.near
        forward_m_s, left_m_s = self.gain_1_s * near.average(near.forward_m), self.gain_1_s * near.average(near.left_m)
        return (*steer(forward_m_s, left_m_s, self.max_linear_m_s), memory)


class LeaderFollowers(Behavior):
    """Robot 0 drives a wide circle; each of the others follows the robot numbered before it at gap_m."""

    near = Neighbors()
    metric = "consensus_error"
    gap_m = 0.15
    apart_m = 0.1  # from all others
    gain_1_s = 1.0
    leader_m_s, leader_rad_s = 0.05, 0.08
    max_linear_m_s = 0.12
    settings = {"gap_m": RANGE, "leader_m_s": SPEED}

    def step(self, sensed: Sensed, memory: Any, random: Random) -> Command:
        near, numbers = sensed.near, sensed.numbers
        robots, leads = np.arange(len(numbers)), np.maximum(numbers - 1, 0)
        ahead_m, left_m = near.forward_m[robots, leads], near.left_m[robots, leads]
        range_m = np.maximum(np.hypot(ahead_m, left_m), 1e-6)
        speed = self.gain_1_s * (range_m - self.gap_m) / range_m
        away_m_s = keep_apart(near, self.apart_m, 4.0)
        forward_m_s, left_m_s = np.array((np.maximum(speed * ahead_m, 0.0), speed * left_m)) + away_m_s
        linear_m_s, angular_rad_s = steer(forward_m_s, left_m_s, self.max_linear_m_s)
        is_leader = numbers == 0
        return (
            np.where(is_leader, self.leader_m_s, linear_m_s),
            np.where(is_leader, self.leader_rad_s, angular_rad_s),
            memory,
        )


class Formation(Behavior):
    """Robots take the distances of a regular polygon from each other, wherever and however turned it comes to lie.

    Gradient of the squared errors of the squared distances (L. Krick, M. Broucke, B. Francis, Int. J. Control 2009);
    the corners are taken in the order in which robots are around their center.
    """

    near = Neighbors()
    metric = "fatness"
    side_m = 0.25
    apart_m = 0.12
    gain_1_m2s = 0.6
    max_linear_m_s = 0.08
    settings = {"side_m": RANGE, "max_linear_m_s": SPEED}

    def step(self, sensed: Sensed, memory: Any, random: Random) -> Command:
        near, count = sensed.near, sensed.count
        steps = 1 + find_angles_ahead(near).argsort(axis=1).argsort(axis=1)
        wanted_m2 = (self.side_m * np.sin(np.pi * steps / count) / np.sin(np.pi / count)) ** 2
        off_m2 = (near.forward_m**2 + near.left_m**2 - wanted_m2) * near.seen
        pull_m_s = self.gain_1_m2s * np.array([(off_m2 * to_m).sum(axis=1) for to_m in (near.forward_m, near.left_m)])
        forward_m_s, left_m_s = pull_m_s + keep_apart(near, self.apart_m, 2.0)
        return (*steer(forward_m_s, left_m_s, self.max_linear_m_s), memory)
