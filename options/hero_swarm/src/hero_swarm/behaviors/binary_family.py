"""Behaviors of one bit that were evolved: two pairs of wheel speeds, for nothing and for a robot seen.

Source: D. S. Brown et al., Discovery and Exploration of Novel Swarm Behaviors given Limited Robot Capabilities, DARS
2016; C. Mattson and D. S. Brown, Leveraging Human Feedback to Evolve and Discover Novel Emergent Behaviors in Robot
Swarms, GECCO 2023. Each holds for the number of robots and the arena in its description.
"""

from typing import Any

import numpy as np

from hero_sim.world import join_wheels

from ..behavior import PULSES, SPEED, VELOCITY, Behavior, Binary, Command, Random, Sensed


class WheelGenome(Behavior):
    """Wheel speeds of the left and right wheel, as shares of wheel_m_s: with nothing seen (0) and a robot seen (1)."""

    sees = Binary()
    drive = PULSES
    rate_hz = 1000.0 / 60.0  # as often as the driver sends commands
    wheel_m_s = 0.12
    settings = {"wheel_m_s": SPEED}
    left0 = right0 = left1 = right1 = 0.0

    def step(self, sensed: Sensed, memory: Any, random: Random) -> Command:
        left_m_s = self.wheel_m_s * np.where(sensed.sees, self.left1, self.left0)
        right_m_s = self.wheel_m_s * np.where(sensed.sees, self.right1, self.right0)
        return (*join_wheels(left_m_s, right_m_s), memory)


class EvolvedAggregation(WheelGenome):
    """Robots gather: 20 robots, 1.71 m x 1.42 m."""

    metric = "cluster_fraction"
    left0, right0, left1, right1 = -0.7, -1.0, 1.0, -1.0


class CyclicPursuit(WheelGenome):
    """Robots circle behind each other on one ring: 20 robots, 1.71 m x 1.42 m."""

    metric = "rotation"
    left0, right0, left1, right1 = -0.7, 0.3, 1.0, 1.0


class Dispersal(WheelGenome):
    """Robots keep away from each other: 20 robots, 1.71 m x 1.42 m."""

    metric = "nearest_neighbor"
    left0, right0, left1, right1 = 0.2, 0.7, -0.5, -0.1


class Milling(WheelGenome):
    """Robots circle a common center, like fish: 20 robots, 1.71 m x 1.42 m."""

    metric = "rotation"
    left0, right0, left1, right1 = 0.8, 1.0, 0.5, 0.6


class WallFollowing(WheelGenome):
    """Robots follow the walls: 9 robots, 1.71 m x 1.42 m; more of them jam."""

    metric = "nearest_neighbor"
    rate_hz = 20.0
    drive = VELOCITY  # a turn so slight needs wheels of equal speed, which servo pulses alone do not give
    left0, right0, left1, right1 = 1.0, 0.95, 1.0, 1.0
