"""The frame of a motion with an end: it is reached, or fails with a reason. Pure.

Proximity sensors show an obstacle in the way: wheels that slip at a wall count on, and odometry with them. Odometry
shows wheels that do not turn, and wrong poses from elsewhere. now_s is any clock that never steps back.
"""

import enum
import math
from typing import Optional, Sequence

from hero_node import STOP, Pose, Velocity
from hero_node.robot_constants import BODY_RADIUS_M

from ..values.readings import Obstacle
from .avoidance import find_in_path, shorten_for_body
from .lateness import Lateness
from .pose_check import SAME_M, SAME_RAD, FrozenCheck, PoseCheck, is_apart

DEFAULT_TIMEOUT_S = 120.0

SETTLE_S = 0.5
"""A robot stopped for this long at its goal has reached it; it needs about 0.15 s to come to rest."""

AIM_SHARE = 0.7
"""The robot stops at this share of the tolerance, to be within it after coming to rest."""

SILENT_STEPS = 20
"""After this many steps without a pose, 2 s, the motion has failed: the robot has disconnected. Steps, not seconds: a
program that was suspended has not received poses either."""

MAX_STEP_S = 0.2
"""The part of a step beyond this does not count as time in which the robot was seen: the PC was too busy to run all."""

CLEARANCE_M = 0.02
"""Free space kept between the body and an obstacle in the way."""

APPROACH_GAIN = 0.8
"""Largest speed towards an obstacle in the way, in m/s per meter; scans come 5 times a second."""

BLOCKED_M_S = 0.01
"""A robot that may not drive faster than this towards an obstacle is blocked by it."""

BLOCKED_S = 2.0
"""After this long behind an obstacle the motion has failed; one that drives on, such as a robot, is waited for."""

STALL_S = 5.0
"""After this long without motion of the wheels although they were told to move, the motion has failed. The slowest
command moves wheels after up to 3 s, when the robot's own controller has overcome friction."""

SILENCE_S = 0.4
"""The driver may have stopped a robot whose program took longer for a step; its wheels then start anew."""

STALL_LINEAR_M_S = 0.02
STALL_ANGULAR_RAD_S = 0.2
"""Commands below both may be too slow for the motors."""


class State(enum.Enum):
    """State of a motion."""

    ACTIVE = "active"
    REACHED = "reached"
    FAILED = "failed"


class MotionController:
    """Drives one robot to the end of one motion; subclasses say which by _offset() and _approach().

    Attributes:
        state: see State; once it is not ACTIVE it stays, and step() returns STOP.
        reason: why it failed, for users; empty otherwise.
        distance_m: still to drive at the last step; nan before the first pose.
        body_radius_m: of this robot's model.
        lateness: of its steps; a late motion is slow.
        is_unseen: whether it drives where not every sensor tells, and none sees an obstacle.
    """

    def __init__(self, now_s: float, timeout_s: float = DEFAULT_TIMEOUT_S) -> None:
        """Begin at now_s, by the clock of step(); once timeout_s has passed since then, the motion fails."""
        self.state = State.ACTIVE
        self.reason = ""
        self.distance_m = math.nan
        self.body_radius_m = BODY_RADIUS_M
        self.lateness = Lateness()
        self.is_unseen = False
        self._timeout_s = timeout_s
        self._start_s = now_s
        self._stepped_s = now_s
        self._seen_s = now_s  # runs only while the robot is seen
        self._silent_steps = 0
        self._stopped_since_s = math.inf
        self._blocked_since_s = math.inf
        self._patience_s = BLOCKED_S
        self._obstacle: Optional[Obstacle] = None
        self._moved_pose: Optional[Pose] = None  # by the wheels
        self._moved_s = now_s
        self._frozen_check, self._pose_check = FrozenCheck(), PoseCheck()
        self._at_goal = False

    def step(
        self,
        pose: Optional[Pose],
        ranges: Optional[Sequence[float]],
        now_s: float,
        odometry: Optional[Pose] = None,
        pose_age_s: float = 0.0,
    ) -> Velocity:
        """Return the next command; call it 10 times per second.

        pose: None while it is not known, and so is one that is not finite. ranges: as in avoidance; None: not known.
        odometry: the pose in hero_N/odom, if pose is not that one.
        """
        if self.state is not State.ACTIVE:
            return STOP
        self.lateness.step(now_s)
        if now_s - self._stepped_s > SILENCE_S:
            self._moved_pose = None
        step_s, self._stepped_s = min(now_s - self._stepped_s, MAX_STEP_S), now_s
        if now_s - self._start_s > self._timeout_s:
            text = f"not there after {self._timeout_s:g} s" + self._describe_distance()
            return self._fail("; ".join(filter(None, (text, self._describe_obstacle()))))
        if pose is None or not all(math.isfinite(value) for value in pose):
            self._silent_steps += 1
            return STOP if self._silent_steps < SILENT_STEPS else self._fail("no pose for 2 s")
        self._silent_steps = 0
        self._seen_s += step_s
        seen_s = self._seen_s
        ranges = shorten_for_body(ranges or (), self.body_radius_m)
        # It stops well inside the tolerance and restarts only outside: hysteresis against chattering at the border.
        self._at_goal = self._offset(pose) < (1.0 if self._at_goal else AIM_SHARE)
        command = self._arrive(pose) if self._at_goal else self._approach(pose, ranges, seen_s)
        if self._at_goal and command == STOP:
            self._stopped_since_s = min(self._stopped_since_s, seen_s)
            if seen_s - self._stopped_since_s >= SETTLE_S:
                self.state = State.REACHED
            return STOP
        self._stopped_since_s = math.inf
        command = self._slow_for_obstacle(command, ranges, seen_s)
        command = self.lateness.slow(command, pose_age_s)
        self._check_wheels(odometry or pose, command, seen_s)
        if odometry is not None:
            problem = self._frozen_check.add(pose, odometry, seen_s) or self._pose_check.add(pose, odometry, seen_s)
            if problem:
                self._fail(problem)
        return command if self.state is State.ACTIVE else STOP

    def _offset(self, pose: Pose) -> float:
        """Update distance_m and return how far off the goal is, as a share of the tolerance."""
        raise NotImplementedError

    def _approach(self, pose: Pose, ranges: Sequence[float], seen_s: float) -> Velocity:
        """Return the command on the way; seen_s: like now_s of step(), but runs only while the robot is seen."""
        raise NotImplementedError

    def _arrive(self, pose: Pose) -> Velocity:
        """Return the command at the goal; STOP if nothing is left to do."""
        return STOP

    def _slow_for_obstacle(self, command: Velocity, ranges: Sequence[float], seen_s: float) -> Velocity:
        """Return the command, slower before an obstacle that is nearer than the goal; fail if it stays there."""
        free_m, obstacle = find_in_path(ranges, backward=command.linear_m_s < 0.0)
        self.is_unseen = math.isnan(free_m) and command.linear_m_s != 0.0
        limit_m_s = APPROACH_GAIN * max(0.0, free_m - CLEARANCE_M)
        if obstacle is None or free_m >= self.distance_m or abs(command.linear_m_s) <= limit_m_s:
            self._blocked_since_s = math.inf
            return command
        if limit_m_s > BLOCKED_M_S:
            self._blocked_since_s = math.inf
            return Velocity(math.copysign(limit_m_s, command.linear_m_s), command.angular_rad_s)
        self._obstacle = obstacle
        self._blocked_since_s = min(self._blocked_since_s, seen_s)
        if seen_s - self._blocked_since_s >= self._patience_s:
            self._fail(self._describe_obstacle() + self._describe_distance())
        return Velocity(0.0, command.angular_rad_s)

    def _check_wheels(self, odometry: Pose, command: Velocity, seen_s: float) -> None:
        """Fail if odometry stays the same although the wheels were told to move."""
        is_told_to_move = (
            abs(command.linear_m_s) >= STALL_LINEAR_M_S or abs(command.angular_rad_s) >= STALL_ANGULAR_RAD_S
        )
        last = self._moved_pose
        if not is_told_to_move or last is None or is_apart(last, odometry, SAME_M, SAME_RAD):
            self._moved_pose, self._moved_s = odometry, seen_s
        elif seen_s - self._moved_s >= STALL_S:
            text = "its wheels do not turn: is something blocking them, is the battery empty, or does another program"
            self._fail(text + " stop the robot?")

    def _fail(self, reason: str) -> Velocity:
        self.state = State.FAILED
        self.reason = reason
        return STOP

    def _describe_distance(self) -> str:
        return "" if math.isnan(self.distance_m) else f", {self.distance_m:.3f} m are left"

    def _describe_obstacle(self) -> str:
        """Return the last obstacle in the way, for users; empty if there was none."""
        if self._obstacle is None:
            return ""
        range_m, bearing_rad = self._obstacle
        from_center_m = range_m + self.body_radius_m - BODY_RADIUS_M
        place = f"{from_center_m:.2f} m from the robot's center" if range_m > 0.0 else "too close to measure"
        return f"an obstacle is in the way, {place}, at {math.degrees(bearing_rad):+.0f} degrees"
