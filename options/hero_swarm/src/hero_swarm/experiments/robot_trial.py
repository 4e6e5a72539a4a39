"""One trial of an experiment on robots: from their poses to commands and to the values of its columns. Pure.

The caller measures poses and moves the robots; time is that since the start of the trial.
"""

import math
from typing import Any, Dict, List, Optional, Sequence, Tuple

import numpy as np

from hero_client.values import NO_OBJECTS, PlacedObjects

from ..behavior import Random, derive_seed
from ..control import Control
from ..metrics.own import State
from ..safety import SafetyFilter
from .computing.batch import SAMPLE_S, measure, take_values
from .computing.cell_setup import CellSetup
from .errors import report_place


class RobotTrial:
    """A behavior with its metrics and the end of the trial.

    Attributes:
        safety: the filter of its commands.
        lateness: of its steps and poses.
        remark: why the trial does not count; empty while it does.
    """

    def __init__(
        self, setup: CellSetup, seed: int, names: Sequence[str], safety: SafetyFilter, readings: Any = None
    ) -> None:
        """Begin; names: of the robots, in the order of their poses; readings: their own, as Surroundings.robots."""
        self.remark = ""
        self._experiment, self._arena = setup.experiment, setup.arena
        self._label = "%s, seed %d" % (setup.cell.label, seed)
        self._names = names
        self.safety = safety
        random = Random([derive_seed(seed, "behavior")], len(names))
        self._control = Control(setup.behavior, random, safety, arena=self._arena, robots=readings)
        self.lateness = self._control.lateness
        self._samples: List[np.ndarray] = []
        self._kept: Dict[str, Any] = {}
        self._last: Optional[Tuple[float, np.ndarray]] = None
        self._reached = False

    @property
    def rate_hz(self) -> float:
        """Calls of step() per second."""
        return self._control.rate_hz

    def step(
        self, time_s: float, poses: np.ndarray, ages_s: np.ndarray, things: PlacedObjects = NO_OBJECTS
    ) -> Optional[Tuple[np.ndarray, np.ndarray]]:
        """Return the speeds of all robots, m/s and rad/s (N,), at poses (N, 3); None: the trial has ended.

        A robot without a pose, NaN, or an object of the arena without one ends the trial with a remark.
        Raises: ExperimentError for whatever the behavior raises.
        """
        lost = [name for name, pose in zip(self._names, poses) if not np.isfinite(pose).all()]
        if lost:
            self.remark = f"no pose of {', '.join(lost)} at {time_s:.1f} s"
            return None
        if len(things.radii_m) < len(self._arena.objects):
            self.remark = "poses of %d of the arena's %d objects" % (len(things.radii_m), len(self._arena.objects))
            return None
        with report_place(self._label, self._experiment.sources):
            speeds = self._control.step(time_s, poses[None], things, ages_s[None])
            if time_s >= len(self._samples) * SAMPLE_S:
                self._sample(time_s, poses, things)
        if not self._control.share.all():
            self.remark = f"commands or poses came too late at {time_s:.1f} s"
            return None
        return None if self._reached or time_s >= self._experiment.time_s else speeds

    def _sample(self, time_s: float, poses: np.ndarray, things: PlacedObjects) -> None:
        if self._last is None:
            velocities = np.zeros_like(poses)
        else:
            velocities = (poses - self._last[1]) / max(time_s - self._last[0], 1e-3)
        self._last = (time_s, poses.copy())
        measured, control = (poses[None], velocities[None], things.poses, self.safety.radii_m), self._control
        state = State(time_s, *measured, self._arena, control.sensed, control.memory, control.colors, self._kept)
        (sample,), (self._reached,) = measure(self._experiment, state)
        self._samples.append(sample)

    def list_values(self) -> Tuple[float, ...]:
        """Return the values of the columns, from the samples that were taken; nan without any."""
        if not self._samples:
            return (math.nan,) * len(self._experiment.metrics)
        return take_values(self._experiment, np.array(self._samples))
