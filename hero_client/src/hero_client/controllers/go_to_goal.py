"""Drives one robot to one goal, until it is reached or has failed with a reason. Pure.

Poses and the goal are in one frame, normally hero_N/odom.
"""

import math
from typing import NamedTuple, Optional, Sequence

from hero_node import STOP, Pose, Velocity, wrap_angle
from hero_node.parameters import check_finite

from ..values.readings import NOT_CALIBRATED, find_nearest, is_blind
from .avoidance import bend_around
from .motion import AIM_SHARE, DEFAULT_TIMEOUT_S, MotionController
from .unicycle import GoToLaw, go_to_point, go_to_pose

DEFAULT_TOLERANCE_M = 0.01

FREE_S = 1.5
"""After this long without an obstacle the next one may be passed on the other side."""

BLIND_S = 2.0
"""After this long without ranges, although it is to go around obstacles, the motion has failed."""

PROGRESS_S = 30.0
"""After this long without coming nearer, a robot that goes around obstacles is in a dead end."""

PROGRESS_M = 0.01
"""Nearer by more than this counts as nearer."""


class Goal(NamedTuple):
    """A place to drive to."""

    x_m: float
    y_m: float
    yaw_rad: Optional[float] = None
    """Heading at the end; None for any."""


def make_goal(x_m: float, y_m: float, yaw_rad: Optional[float]) -> Goal:
    """Return a goal that a user gives. Raises: ValueError unless its numbers are finite."""
    check_finite("x, y and yaw of a goal", x_m, y_m, 0.0 if yaw_rad is None else yaw_rad)
    return Goal(x_m, y_m, yaw_rad)


class GoToGoalController(MotionController):
    """Drives one robot to one goal, on a smooth curve into the heading if the goal has one."""

    def __init__(
        self,
        goal: Goal,
        now_s: float,
        tolerance_m: float = DEFAULT_TOLERANCE_M,
        timeout_s: float = DEFAULT_TIMEOUT_S,
        avoid: bool = False,
    ) -> None:
        """avoid: drive around what the proximity sensors see; otherwise an obstacle in the way ends the motion."""
        super().__init__(now_s, timeout_s)
        self.goal = goal
        self._tolerance_m = tolerance_m
        self._avoid = avoid
        self._blind_since_s = math.inf
        self._side = 0
        self._last_bent_s = -math.inf
        self._min_distance_m, self._progress_s = math.inf, now_s
        if avoid:
            self._patience_s = PROGRESS_S

    def change_goal(self, goal: Goal, tolerance_m: float, timeout_s: float, now_s: float) -> None:
        """Drive to another goal of the same frame from now on; its time limit begins now."""
        self.goal, self._tolerance_m, self._timeout_s = goal, tolerance_m, timeout_s
        self._start_s, self._at_goal, self._stopped_since_s = now_s, False, math.inf
        self._min_distance_m, self._progress_s = math.inf, self._seen_s

    def _offset(self, pose: Pose) -> float:
        self.distance_m = math.hypot(self.goal.x_m - pose.x_m, self.goal.y_m - pose.y_m)
        return self.distance_m / self._tolerance_m

    def _arrive(self, pose: Pose) -> Velocity:
        """Return the command at the goal: only the heading is left."""
        if self.goal.yaw_rad is None:
            return STOP
        target = Pose(self.goal.x_m, self.goal.y_m, self.goal.yaw_rad)
        return go_to_pose(pose, target, at_goal=True)

    def _approach(self, pose: Pose, ranges: Sequence[float], seen_s: float) -> Velocity:
        goal, law = self.goal, GoToLaw(tolerance_m=AIM_SHARE * self._tolerance_m)
        if goal.yaw_rad is None:
            command = go_to_point(pose, goal.x_m, goal.y_m, law)
        else:
            command = go_to_pose(pose, Pose(goal.x_m, goal.y_m, goal.yaw_rad), law)
        if not self._avoid:
            return command
        if is_blind(ranges):
            self._blind_since_s = min(self._blind_since_s, seen_s)
            if seen_s - self._blind_since_s > BLIND_S:
                self._fail("it cannot go around obstacles: " + NOT_CALIBRATED)
            return STOP
        self._blind_since_s = math.inf
        bearing_rad = wrap_angle(math.atan2(goal.y_m - pose.y_m, goal.x_m - pose.x_m) - pose.yaw_rad)
        if seen_s - self._last_bent_s > FREE_S:
            self._side = 0
        bent, side = bend_around(command, bearing_rad, self.distance_m, ranges, self._side)
        if side:
            self._side, self._last_bent_s = side, seen_s
            self._obstacle = find_nearest(ranges)
        if self.distance_m < self._min_distance_m - PROGRESS_M:
            self._min_distance_m, self._progress_s = self.distance_m, seen_s
        elif seen_s - self._progress_s > PROGRESS_S:
            self._fail(f"no nearer for {PROGRESS_S:g} s{self._describe_distance()}; {self._describe_obstacle()}")
        return bent
