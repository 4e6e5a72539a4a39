"""Behaviors of one bit that were evolved: two pairs of wheel speeds, for nothing and for a robot seen.

Those that need robots to slide along walls and each other (friction=0) are published numbers of a WheelGenome: milling
0.8 1 0.5 0.6, cyclic pursuit -0.7 0.3 1 1, wall following 1 0.95 1 1.

Source: D. S. Brown et al., Discovery and Exploration of Novel Swarm Behaviors given Limited Robot Capabilities, DARS
2016; C. Mattson and D. S. Brown, Leveraging Human Feedback to Evolve and Discover Novel Emergent Behaviors in Robot
Swarms, GECCO 2023.
"""

from typing import Any

import numpy as np

from hero_node.parameters import number
from hero_sim.world import join_wheels

from ..behavior import PULSES, SPEED, Behavior, Binary, Command, Random, Sensed


class WheelGenome(Behavior):
    """Wheel speeds of the left and right wheel, as shares of wheel_m_s: with nothing seen (0) and a robot seen (1)."""

    sees = Binary()
    drive = PULSES
    rate_hz = 1000.0 / 60.0  # as often as the driver sends commands
    wheel_m_s = 0.12
    left0 = right0 = left1 = right1 = 0.0
    settings = {"wheel_m_s": SPEED, **dict.fromkeys(("left0", "right0", "left1", "right1"), number(0.0, -1.0, 1.0))}

    def step(self, sensed: Sensed, memory: Any, random: Random) -> Command:
        left_m_s = self.wheel_m_s * np.where(sensed.sees, self.left1, self.left0)
        right_m_s = self.wheel_m_s * np.where(sensed.sees, self.right1, self.right0)
        return (*join_wheels(left_m_s, right_m_s), memory)


class EvolvedAggregation(WheelGenome):
    """Robots gather: 20 robots, 1.71 m x 1.42 m."""

    metric = "cluster_fraction"
    left0, right0, left1, right1 = -0.7, -1.0, 1.0, -1.0


class Dispersal(WheelGenome):
    """Robots keep away from each other: 20 robots, 1.71 m x 1.42 m."""

    metric = "nearest_neighbor"
    left0, right0, left1, right1 = 0.2, 0.7, -0.5, -0.1
