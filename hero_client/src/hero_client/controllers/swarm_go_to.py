"""Drives every robot of a swarm to its goal without collisions, by ORCA. Pure."""

import math
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

SOFTNESS = 0.1
"""Softness of half planes: with none, crowds were driven into each other; margin_m is wider than what is given way."""

PROGRESS_M = 0.01
"""Nearer by more than this counts as nearer."""


class SwarmGoToController:
    """Drives every robot to its goal; a robot that has arrived is stopped, and others drive around it.

    Poses and goals of all robots are in one frame.

    Attributes:
        arrived: which robots are in place.
        lateness: of its steps.
    """

    def __init__(
        self,
        goals: Sequence[Tuple[float, float]],
        law: AvoidanceLaw,
        step_s: float,
        seed: int,
        tolerance_m: float = 0.01,
    ) -> None:
        """step_s: planned time between two calls of step(); seed: of the small random nudges."""
        self.goals = [(float(x), float(y)) for x, y in goals]
        self.law = law
        self.step_s = step_s
        self.arrived = [False] * len(self.goals)
        self._tolerance_m = tolerance_m
        self._dock_law = GoToLaw(tolerance_m=AIM_SHARE * tolerance_m, max_linear_m_s=law.max_linear_m_s)
        self._random = np.random.RandomState(seed)
        self._last_places: Optional[np.ndarray] = None
        self._jams = [_Jam() for _ in self.goals]
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
        commands = self._steer(known, ranges, elapsed_s)
        ages_s = [0.0] * len(commands) if pose_ages_s is None else pose_ages_s  # which may be an array
        return [self.lateness.slow(*item) for item in zip(commands, ages_s)]

    def _steer(
        self, poses: Sequence[Pose], ranges: Optional[Sequence[Sequence[float]]], elapsed_s: float
    ) -> List[Velocity]:
        yaws_rad = np.array([pose.yaw_rad for pose in poses])
        headings = np.column_stack((np.cos(yaws_rad), np.sin(yaws_rad)))
        places = np.array([pose[:2] for pose in poses]) + self.law.lookahead_m * headings
        last_places = places if self._last_places is None else self._last_places
        # Measured, not commanded: the motors take half a second to follow.
        velocities = (places - last_places) / elapsed_s
        self._last_places = places
        distances_m = [math.dist(goal, pose[:2]) for goal, pose in zip(self.goals, poses)]
        self.arrived = [
            distance_m < (self._tolerance_m if done else self._dock_law.tolerance_m)
            for done, distance_m in zip(self.arrived, distances_m)
        ]
        straight = np.array([self._want(*item, elapsed_s) for item in zip(self.goals, poses, distances_m, self._jams)])
        wanted, *sensed = avoid_sensed(yaws_rad, ranges or [()] * len(poses), straight, self.law)
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

    def _want(
        self, goal: Tuple[float, float], pose: Pose, distance_m: float, jam: "_Jam", elapsed_s: float
    ) -> np.ndarray:
        """Return the velocity (2,) straight to the goal, with a small nudge; out of a jam, at an angle to that."""
        to_goal_m = np.array([goal[0] - pose.x_m, goal[1] - pose.y_m])
        speed_m_s = min(self.law.max_linear_m_s, SPEED_GAIN * distance_m)
        straight = to_goal_m * (speed_m_s / max(distance_m, 1e-9))
        side = np.array([-straight[1], straight[0]])
        if jam.look(distance_m, elapsed_s):
            jam.angle_rad = self._random.uniform(0.5, 2.5) * self._random.choice((-1.0, 1.0))
        angle_rad = jam.angle_rad if jam.aside else NUDGE_RAD * self._random.uniform(-1.0, 1.0)
        wanted: np.ndarray = straight * math.cos(angle_rad) + side * math.sin(angle_rad)
        return wanted


class _Jam:
    """Checks whether one robot makes progress towards its goal."""

    angle_rad: float
    """To the goal, at which it goes aside."""

    def __init__(self) -> None:
        self._min_distance_m = math.inf
        self._waited_s = 0.0

    @property
    def aside(self) -> bool:
        """Return whether the robot is to go aside now."""
        return self._waited_s > PATIENCE_S

    def look(self, distance_m: float, step_s: float) -> bool:
        """Take the distance to the goal; return whether to begin going aside now."""
        was_aside = self.aside
        self._waited_s += step_s
        if self._waited_s > PATIENCE_S + ASIDE_S or (not was_aside and distance_m < self._min_distance_m - PROGRESS_M):
            self._min_distance_m = distance_m
            self._waited_s = 0.0
        return self.aside and not was_aside
