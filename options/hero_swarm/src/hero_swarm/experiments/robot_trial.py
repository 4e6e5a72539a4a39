"""One trial of an experiment on robots: the way to its start, then poses to commands and to values. Pure.

The caller measures poses and moves the robots; time is that since the start of the trial.
"""

import math
from typing import Any, Dict, List, Optional, Sequence, Tuple

import numpy as np

from hero_client.controllers import AvoidanceLaw, SwarmGoToController, go_to_pose
from hero_client.values import BODY_RADIUS_M, NO_OBJECTS, PlacedObjects
from hero_node import STOP, Pose

from ..behavior import Random, derive_seed
from ..control import Control
from ..metrics.own import State
from ..safety import SafetyFilter
from .computing.batch import SAMPLE_S, measure, take_values
from .computing.cell_setup import CellSetup
from .errors import report_place

PERIOD_S = 0.05
"""Time between two steps of a StartDrive."""

MAX_GAP_S = 2.0
"""Without poses robots wait for so long: a busy PC pauses for half a second now and then."""

_REST_STEPS = 10
"""Motors follow late: robots have arrived when all were there for this many steps."""


class StartDrive:
    """Robots on their way to their places.

    Attributes:
        done: all robots are in their places, and turned.
        lateness: of its steps and poses.
    """

    def __init__(self, places: np.ndarray, body_radius_m: float = BODY_RADIUS_M) -> None:
        """Begin; places: poses (N, 3), x m, y m, yaw rad. body_radius_m: of the widest robot."""
        self.done = False
        self._goals = [Pose(*place) for place in places.tolist()]
        law = AvoidanceLaw(body_m=body_radius_m)
        self._controller = SwarmGoToController([goal[:2] for goal in self._goals], law, PERIOD_S)
        self.lateness = self._controller.lateness
        self._steps_at_rest = 0

    def step(
        self,
        poses: np.ndarray,
        ranges_m: Optional[Sequence[Sequence[float]]] = None,
        now_s: Optional[float] = None,
        ages_s: Optional[Sequence[float]] = None,
    ) -> np.ndarray:
        """Return the speeds of all robots, m/s and rad/s (2, N), at poses (N, 3): zero while a pose of any is NaN.

        ranges_m: what the proximity sensors of each robot see: it does not drive into what has no pose.
        now_s, ages_s: time and age of each pose, as in SwarmGoToController.step().
        """
        known: List[Optional[Pose]] = [Pose(*pose) if np.isfinite(pose).all() else None for pose in poses.tolist()]
        commands = self._controller.step(known, ranges_m, now_s, ages_s)
        for row, (pose, goal) in enumerate(zip(known, self._goals)):
            if self._controller.arrived[row] and None not in known:
                assert pose is not None
                commands[row] = go_to_pose(pose, goal, at_goal=True)
        at_rest = all(self._controller.arrived) and None not in known and set(commands) == {STOP}
        self._steps_at_rest = self._steps_at_rest + 1 if at_rest else 0
        self.done = self._steps_at_rest >= _REST_STEPS
        return np.array(commands).T


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
        self._reached, self._known_s = False, 0.0

    @property
    def rate_hz(self) -> float:
        """Calls of step() per second."""
        return self._control.rate_hz

    def step(
        self, time_s: float, poses: np.ndarray, ages_s: np.ndarray, things: PlacedObjects = NO_OBJECTS
    ) -> Optional[Tuple[np.ndarray, np.ndarray]]:
        """Return the speeds of all robots, m/s and rad/s (N,), at poses (N, 3); None: the trial has ended.

        While a robot has no pose, NaN, all robots wait, for MAX_GAP_S; then the trial ends with a remark, as for an
        object of the arena without one.
        Raises: ExperimentError for whatever the behavior raises.
        """
        lost = [name for name, pose in zip(self._names, poses) if not np.isfinite(pose).all()]
        if lost and time_s < self._known_s + MAX_GAP_S:
            self.lateness.step(time_s)
            return np.zeros(len(poses)), np.zeros(len(poses))
        if lost:
            self.remark = f"no pose of {', '.join(lost)} for {MAX_GAP_S:g} s at {time_s:.1f} s"
            return None
        self._known_s = time_s
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
