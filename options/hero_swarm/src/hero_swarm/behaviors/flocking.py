"""Flocking by alignment, cohesion and separation."""

from typing import Any

import numpy as np

from hero_client.controllers import steer
from hero_node.parameters import number

from ..behavior import RANGE, SPEED, Behavior, Command, Neighbors, Random, Sensed


class Flocking(Behavior):
    """Robots drive together in one direction (C. Reynolds, Flocks, Herds, and Schools, SIGGRAPH 1987).

    Separation and cohesion are one force that changes its sign at spacing_m.
    """

    near = Neighbors(range_m=0.8)
    metric = "order"
    spacing_m = 0.25
    alignment = 0.1  # m/s for neighbors that all head the same way
    cohesion = 0.15  # m/s for each meter off the spacing
    cruise_m_s = 0.05
    max_linear_m_s = 0.1
    settings = {
        "spacing_m": RANGE,
        "alignment": number(0.1, 0.0, 1.0, "m/s"),
        "cohesion": number(0.15, 0.0, 2.0, "1/s"),
        "cruise_m_s": SPEED,
        "max_linear_m_s": SPEED,
    }

    def step(self, sensed: Sensed, memory: Any, random: Random) -> Command:
        near = sensed.near
        range_m = np.maximum(near.range_m, 1e-6)
        pull_m_s = self.cohesion * (range_m - self.spacing_m) * np.minimum(self.spacing_m / range_m, 3.0)
        forward_m_s = self.cruise_m_s + near.average(pull_m_s * near.forward_m / range_m)
        left_m_s = near.average(pull_m_s * near.left_m / range_m)
        forward_m_s += self.alignment * near.average(np.cos(near.heading_rad) - 1.0) / 4.0
        left_m_s += self.alignment * near.average(np.sin(near.heading_rad))
        return (*steer(np.maximum(forward_m_s, 0.02), left_m_s, self.max_linear_m_s), memory)
