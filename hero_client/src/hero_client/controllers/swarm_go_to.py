"""Drives every robot of a swarm to its goal without collisions, by ORCA. Pure."""

from typing import List, Optional, Sequence, Tuple

import numpy as np

from hero_node import STOP, Pose, Velocity

from .half_planes import nearest_allowed, steer
from .lateness import Lateness
from .motion import AIM_SHARE
from .orca import AvoidanceLaw, avoid_others, avoid_sensed
from .unicycle import GoToLaw, go_to_point

DOCKING_M = 0.05
"""Nearer to its goal than this a robot steers its center there, no longer the point in front of the axle."""

SPEED_GAIN = 0.8
"""Wanted speed in m/s per meter to the goal, 1/s."""

NUDGE_RAD = 0.05
"""Largest random turn of the wanted velocity: breaks the symmetry in which all robots wait."""

PATIENCE_S = 4.0
"""A robot without progress for this long is in a jam: it moves aside, to a random side and angle."""

ASIDE_S = 2.0
"""For this long, then it tries again."""

PROGRESS_M = 0.01
"""Nearer by more than this counts as nearer."""

SOFTNESS = 0.1
"""Softness of half planes: with none, crowds were driven into each other; margin_m is wider than what is given way."""


class SwarmGoToController:
    """Drives every robot to its goal, in one frame; one that has arrived is stopped, and others drive around it.

    Attributes:
        arrived: which robots are in place.
        lateness: of its steps.
    """

    def __init__(
        self, goals: Sequence[Tuple[float, float]], law: AvoidanceLaw, step_s: float, tolerance_m: float = 0.01
    ) -> None:
        """goals: x, y (m) of each robot, in its order; step_s: planned time between two calls of step()."""
        self.goals = [(float(x), float(y)) for x, y in goals]
        self.law = law
        self.step_s = step_s
        self.arrived = [False] * len(self.goals)
        self._tolerance_m = tolerance_m
        self._dock_law = GoToLaw(tolerance_m=AIM_SHARE * tolerance_m, max_linear_m_s=law.max_linear_m_s)
        self._last_places: Optional[np.ndarray] = None
        self._random = np.random.RandomState(0)
        self._min_distances_m = np.full(len(self.goals), np.inf)
        self._waited_s = np.zeros(len(self.goals))  # without progress
        self._aside_rad = np.zeros(len(self.goals))
        self.lateness = Lateness(step_s)
        self._now_s = 0.0

    def step(
        self,
        poses: Sequence[Optional[Pose]],
        ranges: Optional[Sequence[Sequence[float]]] = None,
        now_s: Optional[float] = None,
        pose_ages_s: Optional[Sequence[float]] = None,
    ) -> List[Velocity]:
        """Return the next command of every robot: stop while the pose of any robot is None, for it may be anywhere.

        ranges: what the proximity sensors of each robot see, as in avoidance; None: go by the poses alone. now_s: by
        any clock that never steps back; None: step_s after the last call. pose_ages_s: of each pose; None: 0.
        """
        now_s = self._now_s + self.step_s if now_s is None else now_s
        elapsed_s = self.step_s if self._last_places is None else max(now_s - self._now_s, self.step_s)
        self._now_s = now_s
        self.lateness.step(now_s)
        known = [pose for pose in poses if pose is not None]
        if len(known) < len(poses):
            self._last_places = None  # what they drive until the next step is no speed
            return [STOP] * len(poses)
        commands = self._steer(known, ranges or [()] * len(known), elapsed_s)
        ages_s = [0.0] * len(commands) if pose_ages_s is None else pose_ages_s  # which may be an array
        return [self.lateness.slow(*item) for item in zip(commands, ages_s)]

    def _steer(self, poses: Sequence[Pose], ranges: Sequence[Sequence[float]], elapsed_s: float) -> List[Velocity]:
        yaws_rad = np.array([pose.yaw_rad for pose in poses])
        headings = np.column_stack((np.cos(yaws_rad), np.sin(yaws_rad)))
        places = np.array([pose[:2] for pose in poses]) + self.law.lookahead_m * headings
        last_places = places if self._last_places is None else self._last_places
        # Measured, not commanded: the motors take half a second to follow.
        velocities = (places - last_places) / elapsed_s
        self._last_places = places
        to_goals_m = np.array(self.goals) - np.array([pose[:2] for pose in poses])
        distances_m = np.hypot(*to_goals_m.T)
        self.arrived = [
            bool(distance_m < (self._tolerance_m if done else self._dock_law.tolerance_m))
            for done, distance_m in zip(self.arrived, distances_m)
        ]
        speeds_m_s = np.minimum(self.law.max_linear_m_s, SPEED_GAIN * distances_m)
        straight = to_goals_m * (speeds_m_s / np.maximum(distances_m, 1e-9))[:, None]
        turns_rad = self._find_turns(distances_m, elapsed_s)
        cos, sin = np.cos(turns_rad), np.sin(turns_rad)
        straight = np.column_stack(
            (cos * straight[:, 0] - sin * straight[:, 1], cos * straight[:, 1] + sin * straight[:, 0])
        )
        wanted, *sensed = avoid_sensed(yaws_rad, ranges, straight, self.law)
        others = avoid_others(places, velocities, self.law, elapsed_s)
        normals, bounds = (np.concatenate(parts, axis=1) for parts in zip(others, sensed))
        allowed = nearest_allowed(wanted, normals, bounds, self.law.max_linear_m_s, SOFTNESS)
        free = np.hypot(*(allowed - straight).T) < 0.25 * np.hypot(*straight.T)
        forward_m_s = (allowed * headings).sum(axis=1)
        left_m_s = allowed[:, 1] * headings[:, 0] - allowed[:, 0] * headings[:, 1]
        limits = self.law.max_linear_m_s, self.law.lookahead_m, self.law.max_angular_rad_s
        commands = [Velocity(*map(float, speeds)) for speeds in zip(*steer(forward_m_s, left_m_s, *limits))]
        for index, pose in enumerate(poses):
            if self.arrived[index]:
                commands[index] = STOP
            elif distances_m[index] < DOCKING_M and free[index]:
                commands[index] = go_to_point(pose, *self.goals[index], self._dock_law)
        return commands

    def _find_turns(self, distances_m: np.ndarray, elapsed_s: float) -> np.ndarray:
        """Return the angles (N,) at which robots drive to the way to their goals: a nudge, or aside out of a jam."""
        was_aside = self._waited_s > PATIENCE_S
        self._waited_s += elapsed_s
        has_progress = ~was_aside & (distances_m < self._min_distances_m - PROGRESS_M)
        anew = has_progress | (self._waited_s > PATIENCE_S + ASIDE_S)
        self._min_distances_m[anew], self._waited_s[anew] = distances_m[anew], 0.0
        is_aside = self._waited_s > PATIENCE_S
        count = len(distances_m)
        asides_rad = self._random.uniform(0.5, 2.5, count) * self._random.choice((-1.0, 1.0), count)
        self._aside_rad = np.where(is_aside & ~was_aside, asides_rad, self._aside_rad)
        return np.where(is_aside, self._aside_rad, NUDGE_RAD * self._random.uniform(-1.0, 1.0, count))
