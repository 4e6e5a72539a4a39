"""The control loop of a behavior: it decides at its own rate, the safety filter acts at its rate or more often. Pure.

All that drives robots by a behavior steps this loop: trials on simulated robots and on robots, the program behavior.
"""

import math
from typing import Any, Optional, Tuple

import numpy as np

from hero_client.values import NO_OBJECTS, PlacedObjects

from .behavior import Behavior, Random, Sensed, decide, sense
from .safety import SafetyFilter


class Control:
    """Commands of a behavior, made safe between its decisions as well.

    Attributes:
        rate_hz: calls of step() per second: the behavior's rate, or a multiple of it.
        steps_per_decision: calls of step() of which the first one senses and decides.
        has_decided: whether the last call did.
        sensed: what the behavior sensed then.
        memory, colors: what it remembers and shows.
        wanted: linear m/s and angular rad/s of all robots (2, R), as it decided last.
    """

    sensed: Sensed

    def __init__(
        self, behavior: Behavior, random: Random, safety: Optional[SafetyFilter] = None, **surroundings: Any
    ) -> None:
        """Begin; without safety, commands are those of the behavior. surroundings: what sensors read: see sense()."""
        self._surroundings = {"kept": {}, **surroundings}
        self._behavior, self._random, self._safety = behavior, random, safety
        safety_hz = 0.0 if safety is None else safety.rate_hz
        self.steps_per_decision = max(1, math.ceil(safety_hz / behavior.rate_hz - 1e-9))
        self.rate_hz = self.steps_per_decision * behavior.rate_hz
        self.has_decided = False
        self.memory: Any = None
        self.colors: Optional[np.ndarray] = None
        self.wanted = np.empty((2, 0))
        self._steps = 0

    def step(
        self, time_s: float, poses: np.ndarray, things: PlacedObjects = NO_OBJECTS, ages_s: Optional[np.ndarray] = None
    ) -> Tuple[np.ndarray, np.ndarray]:
        """Return linear and angular speeds of all robots (R,) at poses (W, N, 3) that are ages_s old (W, N).

        Raises: ValueError, or whatever the behavior raises.
        """
        self.has_decided = self._steps % self.steps_per_decision == 0
        self._steps += 1
        if self.has_decided:
            around = {**self._surroundings, "colors": self.colors}
            self.sensed = sense(self._behavior, time_s, poses, self._random, things, **around)
            *wanted, self.memory = decide(self._behavior, self.sensed, self.memory, self._random)
            self.wanted = np.array(wanted)
            self.colors = self._behavior.colors(self.memory)
        linear_m_s, angular_rad_s = self.wanted
        if self._safety is None:
            return linear_m_s, angular_rad_s
        linear_m_s, angular_rad_s = self._safety(poses, linear_m_s, angular_rad_s, ages_s)
        return linear_m_s.ravel(), angular_rad_s.ravel()
