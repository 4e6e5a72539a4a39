"""Drives one robot to one goal, until it is reached or has failed with a reason. Pure.

Poses and the goal are in one frame, normally hero_N/odom; now_s is any clock that never steps back.
"""

import enum
import math
from typing import Callable, Dict, NamedTuple, Optional, Sequence

from ..geometry import STOP, Pose, Velocity, wrap_angle
from .avoidance import bend_around
from .unicycle import BRISK, GoToLaw, GoToPoseLaw, go_to_point, go_to_pose

__all__ = [
    "DEFAULT_LAW",
    "DEFAULT_TIMEOUT_S",
    "DEFAULT_TOLERANCE_M",
    "LAWS",
    "GoToGoalController",
    "Goal",
    "State",
]

SETTLE_S = 0.5
"""A robot stopped for so long at its goal has reached it; it needs about 0.15 s to come to rest."""

AIM_SHARE = 0.7
"""The robot stops at this share of the tolerance, to be within it after coming to rest."""

FREE_S = 1.5
"""After so long without an obstacle the next one may be passed on the other side."""

SILENCE_S = 2.0
"""After so long without a pose the goal has failed: the robot is gone."""

DEFAULT_TOLERANCE_M = 0.01

DEFAULT_TIMEOUT_S = 120.0


class State(enum.Enum):
    """State of a controller."""

    ACTIVE = "active"
    REACHED = "reached"
    FAILED = "failed"


class Goal(NamedTuple):
    """Where a robot is to drive."""

    x_m: float
    y_m: float
    yaw_rad: Optional[float] = None
    """Heading at the end; None for any."""


def _tutorial(pose: Pose, goal: Goal, tolerance_m: float) -> Velocity:
    return go_to_point(pose, goal.x_m, goal.y_m, GoToLaw(tolerance_m=tolerance_m))


def _brisk(pose: Pose, goal: Goal, tolerance_m: float) -> Velocity:
    return go_to_point(pose, goal.x_m, goal.y_m, BRISK._replace(tolerance_m=tolerance_m))


def _smooth(pose: Pose, goal: Goal, tolerance_m: float) -> Velocity:
    if goal.yaw_rad is None:
        return _brisk(pose, goal, tolerance_m)
    target = Pose(goal.x_m, goal.y_m, goal.yaw_rad)
    return go_to_pose(pose, target, GoToPoseLaw(tolerance_m=tolerance_m))


LAWS: Dict[str, Callable[[Pose, Goal, float], Velocity]] = {
    "tutorial": _tutorial,
    "brisk": _brisk,
    "smooth": _smooth,
}
"""tutorial: slow, any heading. brisk: quicker, any heading. smooth: brisk, and a curve into the heading if given."""

DEFAULT_LAW = "smooth"


class GoToGoalController:
    """Drives one robot to one goal.

    Attributes:
        state: see State; once it is not ACTIVE it stays, and step() returns STOP.
        reason: why it failed, for users; empty otherwise.
        distance_m: from the goal at the last step; nan before the first pose.
    """

    def __init__(
        self,
        goal: Goal,
        now_s: float,
        tolerance_m: float = DEFAULT_TOLERANCE_M,
        timeout_s: float = DEFAULT_TIMEOUT_S,
        law: str = DEFAULT_LAW,
    ) -> None:
        """Begin at now_s; law: a key of LAWS. Raises: ValueError for a law that is not there."""
        if law not in LAWS:
            raise ValueError("no law %r; there are: %s" % (law, ", ".join(LAWS)))
        self.goal = goal
        self.state = State.ACTIVE
        self.reason = ""
        self.distance_m = math.nan
        self._tolerance_m = tolerance_m
        self._timeout_s = timeout_s
        self._law = LAWS[law]
        self._start_s = now_s
        self._last_pose_s = now_s
        self._stopped_since_s: Optional[float] = None
        self._blocked_m = math.inf
        self._at_goal = False
        self._side = 0
        self._last_bent_s = -math.inf

    def step(self, pose: Optional[Pose], ranges: Optional[Sequence[float]], now_s: float) -> Velocity:
        """Return the next command.

        pose: None while it is not known, and so is one that is not finite. ranges: as in avoidance, to go around
        what they see; None: do not look.
        """
        if self.state is not State.ACTIVE:
            return STOP
        if now_s - self._start_s > self._timeout_s:
            return self._fail(self._tell_time_limit())
        if pose is None or not all(math.isfinite(value) for value in pose):
            if now_s - self._last_pose_s > SILENCE_S:
                return self._fail("no odometry for %g s" % SILENCE_S)
            return STOP
        self._last_pose_s = now_s
        self.distance_m = math.hypot(self.goal.x_m - pose.x_m, self.goal.y_m - pose.y_m)
        # It stops well inside the tolerance and restarts only outside: hysteresis against chattering at the border.
        self._at_goal = self.distance_m < self._tolerance_m * (1.0 if self._at_goal else AIM_SHARE)
        command = self._arrive(pose) if self._at_goal else self._approach(pose, ranges, now_s)
        if not self._at_goal or command != STOP:
            self._stopped_since_s = None
        elif self._stopped_since_s is None:
            self._stopped_since_s = now_s
        elif now_s - self._stopped_since_s >= SETTLE_S:
            self.state = State.REACHED
        return command

    def _arrive(self, pose: Pose) -> Velocity:
        """Return the command at the goal: only the heading is left."""
        if self.goal.yaw_rad is None or self._law is not _smooth:
            return STOP
        target = Pose(self.goal.x_m, self.goal.y_m, self.goal.yaw_rad)
        return go_to_pose(pose, target, GoToPoseLaw(), at_goal=True)

    def _approach(self, pose: Pose, ranges: Optional[Sequence[float]], now_s: float) -> Velocity:
        command = self._law(pose, self.goal, AIM_SHARE * self._tolerance_m)
        if ranges is None:
            return command
        bearing_rad = wrap_angle(
            math.atan2(self.goal.y_m - pose.y_m, self.goal.x_m - pose.x_m) - pose.yaw_rad
        )
        if now_s - self._last_bent_s > FREE_S:
            self._side = 0
        bent, side = bend_around(command, bearing_rad, self.distance_m, ranges, self._side)
        self._blocked_m = min(ranges) if side else math.inf
        if side:
            self._side, self._last_bent_s = side, now_s
        return bent

    def _fail(self, reason: str) -> Velocity:
        self.state = State.FAILED
        self.reason = reason
        return STOP

    def _tell_time_limit(self) -> str:
        text = "not there after %g s" % self._timeout_s
        if not math.isnan(self.distance_m):
            text += ", %.3f m are left" % self.distance_m
        if math.isfinite(self._blocked_m):
            text += "; something is in the way, %.2f m from the robot" % self._blocked_m
        return text
