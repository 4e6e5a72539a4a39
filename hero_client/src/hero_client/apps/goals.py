"""One robot's goals: which are accepted, that a new one replaces the old one, and how each ends. Pure.

A new goal in the same frame turns the robot on its way, without a stop: goals may come as a stream. Only the newest of
those that wait is driven to.

Goals and cancellations may come from any thread; the one that calls drive_to_next() drives the robot.
"""

import math
import queue
from abc import ABC, abstractmethod
from typing import Any, Callable, NamedTuple, Tuple

from hero_node import HeroError, yaw_of
from hero_node.parameters import MAX_COORDINATE_M

from ..controllers.go_to_goal import Goal, GoToGoalController
from ..controllers.motion import State
from ..robots.robot_base import BaseRobot

FEEDBACK_PERIOD_S = 0.5

MAX_QUEUED_GOALS = 100
"""More goals at once are rejected."""

MAX_QUATERNION_ENTRY = 1e3
"""A unit quaternion has no entry beyond 1."""

MAX_FRAME_LENGTH = 200

REPLACED = "another goal came"
"""Why a goal was given up of which a newer one took the place."""


class InvalidGoalError(ValueError):
    """A goal that no robot can be sent to; the text says why."""


def read_goal(message: Any, use_heading: bool) -> Tuple[Goal, str]:
    """Return the goal in a geometry_msgs/PoseStamped and its frame; an empty frame means the robot's own odometry.

    A quaternion of zeros, as sent by tools that do not care, means no heading. What passes here leads to no command
    that is not finite, and to no frame name that tf2 or a log line cannot take.
    Raises: InvalidGoalError.
    """
    frame = message.header.frame_id
    if not frame.isprintable() or len(frame) > MAX_FRAME_LENGTH:
        raise InvalidGoalError(
            "frame_id must be up to %d printable characters, not %s" % (MAX_FRAME_LENGTH, ascii(frame[:40]))
        )
    position, orientation = message.pose.position, message.pose.orientation
    if not (abs(position.x) <= MAX_COORDINATE_M and abs(position.y) <= MAX_COORDINATE_M):
        raise InvalidGoalError(
            f"a goal must be finite, not ({position.x:g}, {position.y:g}), and within {MAX_COORDINATE_M:g} m"
        )
    if not use_heading:
        return Goal(position.x, position.y), frame
    entries = (orientation.x, orientation.y, orientation.z, orientation.w)
    if not all(abs(entry) <= MAX_QUATERNION_ENTRY for entry in entries):
        raise InvalidGoalError("the goal's orientation is no quaternion: (%g, %g, %g, %g)" % entries)
    known = sum(abs(entry) for entry in entries) > 1e-6
    return Goal(position.x, position.y, yaw_of(orientation) if known else None), frame


def check_limits(tolerance_m: float, timeout_s: float) -> None:
    """Raises: InvalidGoalError unless both are more than 0 and finite."""
    if not (0.0 < tolerance_m < math.inf and 0.0 < timeout_s < math.inf):
        raise InvalidGoalError(
            f"tolerance and timeout must be finite and not negative, not {tolerance_m:g} m, {timeout_s:g} s"
        )


class GoalRequest(NamedTuple):
    """A goal as received."""

    goal: Goal
    frame: str
    """Empty: the robot's own odometry frame."""
    tolerance_m: float
    timeout_s: float
    handle: Any = None
    """The action's goal handle; None for goals from topics and parameters."""


class GoalOutcome(NamedTuple):
    """Outcome of a goal."""

    reached: bool
    gave_up: bool
    """True if it was replaced or cancelled, or the program ended; no failure of the robot."""
    reason: str
    """Why it was not reached, for users."""
    distance_m: float
    """Still to drive; nan before the first pose."""
    elapsed_s: float


class GoalQueue(ABC):
    """The goals of one robot, which has one at a time.

    Attributes:
        robot: the robot.
        reached: whether the last goal was reached.
    """

    def __init__(self, robot: BaseRobot, avoid: bool = False) -> None:
        """avoid: whether to drive around what the proximity sensors see; otherwise a goal behind it fails."""
        self.robot = robot
        self.reached = False
        self._avoid = avoid
        self._requests: queue.Queue[GoalRequest] = queue.Queue(MAX_QUEUED_GOALS)
        self._cancelled: Any = None
        self._is_closed = False

    @abstractmethod
    def accept_goal(self, request: GoalRequest) -> None:
        """The robot begins to drive to a goal."""

    @abstractmethod
    def show_progress(self, request: GoalRequest, distance_m: float, elapsed_s: float) -> None:
        """The robot is on its way; every FEEDBACK_PERIOD_S."""

    @abstractmethod
    def end_goal(self, request: GoalRequest, outcome: GoalOutcome) -> None:
        """The goal has ended, and the robot is stopped."""

    @property
    def busy(self) -> bool:
        """Return whether there is a goal to drive to."""
        return self._requests.unfinished_tasks > 0

    def put(self, request: GoalRequest) -> None:
        """Take a goal in place of the present one. Raises: InvalidGoalError if MAX_QUEUED_GOALS wait."""
        try:
            self._requests.put_nowait(request)
        except queue.Full:
            raise InvalidGoalError("more than %d goals at once" % MAX_QUEUED_GOALS) from None

    def cancel(self, handle: Any) -> None:
        """Give up the goal with this handle."""
        self._cancelled = handle

    def give_up(self) -> None:
        """End the goal and take no more; the program ends."""
        self._is_closed = True

    def _find_interruption(self, handle: Any) -> str:
        """Return why the goal of this handle is to be given up; empty if it is not."""
        if self._is_closed:
            return "the program ends"
        # A goal handle cannot be compared with None.
        if handle is not None and self._cancelled is not None and handle == self._cancelled:
            return "cancelled"
        return "" if self._requests.empty() else REPLACED

    def _take_newest(self) -> GoalRequest:
        """Return the newest goal that waits, of at least one; the older ones end."""
        request = self._requests.get()
        while not self._requests.empty():
            self._end_replaced(request, math.nan, 0.0)
            request = self._requests.get()
        return request

    def _end_replaced(self, request: GoalRequest, distance_m: float, elapsed_s: float) -> None:
        self.end_goal(request, GoalOutcome(False, True, REPLACED, distance_m, elapsed_s))
        self._requests.task_done()

    def drive_to_next(self, wait: Callable[[float], object]) -> bool:
        """Drive to the next goal until it is reached, fails or is given up; return whether there was one.

        wait: waits for this many seconds, or less if put(), cancel() or give_up() were called.
        """
        if self._is_closed or self._requests.empty():
            return False
        self._drive(self._take_newest(), wait)
        self._requests.task_done()
        return True

    def _drive(self, request: GoalRequest, wait: Callable[[float], object]) -> None:
        start_s = next_feedback_s = self.robot.now_s
        distance_m = math.nan
        self.reached = False

        def can_turn_to_next() -> bool:
            # Places in the robot's own frame are those of the moment at which it begins.
            return request.frame != "robot" and self._requests.queue[-1].frame == request.frame

        def sleep(duration_s: float) -> bool:
            end_s = self.robot.now_s + duration_s
            while duration_s > 0.0:
                wait(duration_s)
                interruption = self._find_interruption(request.handle)
                if interruption and not (interruption == REPLACED and can_turn_to_next()):
                    return False
                duration_s = end_s - self.robot.now_s
            return True

        def on_step(controller: GoToGoalController) -> None:
            nonlocal request, start_s, distance_m, next_feedback_s
            distance_m, now_s = controller.distance_m, self.robot.now_s
            if controller.state is State.ACTIVE and not self._requests.empty() and can_turn_to_next():
                self._end_replaced(request, distance_m, now_s - start_s)
                request, start_s = self._take_newest(), now_s
                controller.change_goal(request.goal, request.tolerance_m, request.timeout_s, now_s)
                self.accept_goal(request)
            if now_s >= next_feedback_s:
                next_feedback_s = now_s + FEEDBACK_PERIOD_S
                self.show_progress(request, distance_m, now_s - start_s)

        self.accept_goal(request)
        reason = interruption = ""
        try:
            # A robot that has yet to join is waited for as long as it then may drive.
            self.robot.wait_until_ready(request.timeout_s, sleep)
            self.robot.go_to(
                *request.goal,
                request.frame or "odom",
                self._avoid,
                request.timeout_s,
                request.tolerance_m,
                sleep,
                on_step,
            )
            self.reached = True
        except HeroError as error:
            interruption = self._find_interruption(request.handle)
            reason = interruption or str(error)
        elapsed_s = self.robot.now_s - start_s
        self.end_goal(request, GoalOutcome(self.reached, bool(interruption), reason, distance_m, elapsed_s))
