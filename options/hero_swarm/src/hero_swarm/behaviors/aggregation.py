"""Aggregation without computation: one bit, two wheel speeds."""

import math
from typing import Any

import numpy as np

from ..behavior import PULSES, Behavior, Binary, Command, Random, Sensed


class Aggregation(Behavior):
    """Aggregation by one bit (Gauci et al. 2014, doi 10.1177/0278364914525244)."""

    sees = Binary(half_angle_rad=0.0, range_m=math.inf)
    rate_hz = 20.0
    drive = PULSES
    metric = "dispersion_ratio"
    v0_m_s, w0_rad_s = -0.108, -0.75  # nothing seen
    v1_m_s, w1_rad_s = 0.0, -5.02  # a robot seen

    def step(self, sensed: Sensed, memory: Any, random: Random) -> Command:
        linear_m_s = np.where(sensed.sees, self.v1_m_s, self.v0_m_s)
        return linear_m_s, np.where(sensed.sees, self.w1_rad_s, self.w0_rad_s), memory
