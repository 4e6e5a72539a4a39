"""The control loop of a behavior: it decides at its own rate, the safety filter acts at its rate or more often. Pure.

All that drives robots by a behavior steps this loop: trials on simulated robots and on robots, the program behavior.
"""

import math
from collections import deque
from typing import Any, Deque, Dict, Optional, Tuple

import numpy as np

from hero_client.controllers import Lateness
from hero_client.values import NO_OBJECTS, PlacedObjects

from .behavior import Behavior, Random, Sensed, act, decide, sense
from .safety import MAX_AGE_S, SafetyFilter

LAG_S = 0.13
"""Mean time from a command to the wheels: 51 ms between reads, 47 Hz of the velocity controller, 80 ms of servos."""


class Control:
    """Commands of a behavior, made safe between its decisions as well.

    Attributes:
        rate_hz: calls of step() per second: the behavior's rate, or a multiple of it.
        steps_per_decision: calls of step() of which the first one senses and decides.
        has_decided: whether the last call did.
        sensed: what the behavior sensed then.
        memory: what it remembers.
        wanted: linear m/s and angular rad/s of all robots (2, R), as it decided last.
        lateness: of its steps and of the poses that it is given; robots are slow meanwhile.
        share: of its speed at which each robot drives therefore, 0 to 1 (R,).
    """

    sensed: Sensed
    share: np.ndarray

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
        self._acts: Dict[str, Optional[np.ndarray]] = {}
        self.wanted = np.empty((2, 0))
        self.lateness = Lateness(1.0 / self.rate_hz)
        self._sent: Deque[Tuple[float, np.ndarray]] = deque()  # when, and which speeds (2, R)
        self._steps = 0

    @property
    def colors(self) -> Optional[np.ndarray]:
        """Colors of the robots (R, 3), or None."""
        return self._acts.get("colors")

    def step(
        self, time_s: float, poses: np.ndarray, things: PlacedObjects = NO_OBJECTS, ages_s: Optional[np.ndarray] = None
    ) -> Tuple[np.ndarray, np.ndarray]:
        """Return linear and angular speeds of all robots (R,) at poses (W, N, 3) that are ages_s old (W, N).

        time_s: by any clock that never steps back. Without ages and a filter, commands are those of the behavior.
        Raises: ValueError, or whatever the behavior raises.
        """
        self.has_decided = self._steps % self.steps_per_decision == 0
        self._steps += 1
        if self.has_decided:
            around = {**self._surroundings, **self._acts}
            self.sensed = sense(self._behavior, time_s, poses, self._random, things, **around)
            *wanted, self.memory = decide(self._behavior, self.sensed, self.memory, self._random)
            self.wanted = np.array(wanted)
            self._acts = act(self._behavior, self.memory, self.wanted.shape[1])
        speeds = self.wanted
        if self._safety is None and ages_s is None:
            return speeds[0], speeds[1]
        ages_s = np.zeros(poses.shape[:2]) if ages_s is None else ages_s
        if self._safety is not None:
            poses = self._predict(poses, ages_s, time_s)
            speeds = np.array(self._safety(poses, speeds[0], speeds[1], ages_s)).reshape(2, -1)
        self.lateness.step(time_s)
        self.share = np.array(self.lateness.find_shares(ages_s.ravel().tolist()))
        speeds = speeds * self.share
        self._sent.append((time_s, speeds))
        return speeds[0], speeds[1]

    def _predict(self, poses: np.ndarray, ages_s: np.ndarray, time_s: float) -> np.ndarray:
        """Return where robots are now, by the commands that were sent since their poses were true."""
        if self._sent and self._sent[-1][0] > time_s:
            self._sent.clear()  # a simulation that begins again
        while len(self._sent) > 1 and self._sent[1][0] <= time_s - LAG_S - MAX_AGE_S:
            self._sent.popleft()
        poses, since_s = poses.copy(), time_s - LAG_S - np.clip(ages_s, 0.0, MAX_AGE_S)
        ends_s = [sent_s for sent_s, _ in self._sent][1:] + [time_s]
        for (sent_s, speeds), end_s in zip(self._sent, ends_s):
            driven_s = np.maximum(end_s - np.maximum(since_s, sent_s), 0.0)
            linear_m, turn_rad = driven_s * speeds.reshape(2, *driven_s.shape)
            heading_rad = poses[..., 2] + 0.5 * turn_rad
            poses += np.stack((linear_m * np.cos(heading_rad), linear_m * np.sin(heading_rad), turn_rad), axis=-1)
        return poses
