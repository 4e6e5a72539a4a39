"""Behaviors that circle the center of the swarm, without contact: milling and cyclic pursuit."""

from typing import Any

import numpy as np

from hero_client.controllers import steer

from ..behavior import RANGE, SPEED, Behavior, Command, Neighborhood, Neighbors, Proximity, Random, Sensed
from .clearance import keep_clear


def find_center(near: Neighborhood) -> np.ndarray:
    """Return where the center of each robot and its neighbors is, forward and left in m (2, R)."""
    return np.array((near.forward_m.sum(axis=1), near.left_m.sum(axis=1))) / (near.counts + 1.0)


def find_angles_ahead(near: Neighborhood) -> np.ndarray:
    """Return how far ahead of each robot others are around the center of all, counter-clockwise, 0 to 2 pi (R, N).

    inf for the robot itself and for those that it does not see.
    """
    forward_m, left_m = find_center(near)
    angles_rad = np.arctan2(near.left_m - left_m[:, None], near.forward_m - forward_m[:, None])
    own_rad = np.arctan2(-left_m, -forward_m)
    return np.where(near.seen, np.mod(angles_rad - own_rad[:, None], 2.0 * np.pi), np.inf)


class Milling(Behavior):
    """Robots circle the center of those they see, counter-clockwise, clear of what their infrared sensors see.

    As in the mills of M. D'Orsogna et al., Self-propelled particles with soft-core interactions, PRL 2006.
    """

    near = Neighbors(range_m=2.0)
    infrared = Proximity()
    metric = "rotation"
    radius_m = 0.45  # beyond it robots turn in, inside of it out
    clear_m = 0.14  # from the center
    gain_1_s = 2.0
    linear_m_s = 0.08
    settings = {"linear_m_s": SPEED, "radius_m": RANGE}

    def step(self, sensed: Sensed, memory: Any, random: Random) -> Command:
        forward_m, left_m = center_m = find_center(sensed.near)
        range_m = np.maximum(np.hypot(forward_m, left_m), 1e-6)
        inward = np.clip(range_m / self.radius_m - 1.0, -1.0, 1.0)
        around = np.array((left_m, -forward_m)) * self.find_speed(sensed)
        wanted = self.linear_m_s * (inward * center_m + around) / range_m
        forward_m_s, left_m_s = wanted + keep_clear(sensed.infrared.ranges_m, self.clear_m, self.gain_1_s)
        return (*steer(forward_m_s, left_m_s, self.linear_m_s), memory)

    def find_speed(self, sensed: Sensed) -> Any:
        """Return how fast each robot circles the center, as a share of linear_m_s."""
        return 1.0


class CyclicPursuit(Milling):
    """Robots drive on one ring, each behind the next one, until all are as far apart.

    After T.-H. Kim and T. Sugie, Cooperative control for target-enclosing task based on a cyclic pursuit strategy,
    Automatica 2007.
    """

    clear_m = 0.12

    def find_speed(self, sensed: Sensed) -> Any:
        """Return more for a robot with more room ahead than in a regular polygon."""
        room_rad = find_angles_ahead(sensed.near).min(axis=1)
        return np.clip(room_rad * sensed.count / (2.0 * np.pi), 0.3, 1.5)
