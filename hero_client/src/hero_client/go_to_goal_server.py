"""Serves goals of one robot: the topic /hero_N/goal and the action /hero_N/go_to, one process for any number of robots.

A robot has one goal at a time: a new one, wherever it comes from, replaces the old one. Callbacks only queue requests,
because actionlib holds its lock meanwhile; a thread of each server drives the robot.
"""

import math
import queue
import threading
import time
from typing import Any, NamedTuple, Tuple

import actionlib
import rospy
from geometry_msgs.msg import PoseStamped

from hero_msgs.msg import GoToAction, GoToFeedback, GoToResult

from .controllers.go_to_goal import DEFAULT_TOLERANCE_M, Goal
from .controllers.motion import DEFAULT_TIMEOUT_S, MotionController
from .errors import HeroError
from .geometry import yaw_of
from .robot import Robot

__all__ = ["MAX_COORDINATE_M", "GoToGoalServer", "InvalidGoalError", "check_limits", "read_goal"]

FEEDBACK_PERIOD_S = 0.5
"""Between two feedback messages of an action."""

CLOSE_TIMEOUT_S = 1.0
"""Giving up a goal takes 0.2 s."""

MAX_QUEUED_GOALS = 100
"""More goals at once are rejected."""

MAX_COORDINATE_M = 1e6
"""The driver accepts poses within the same limit. Beyond it, sums lose precision."""

MAX_QUATERNION_ENTRY = 1e3
"""A unit quaternion has no entry beyond 1."""

MAX_FRAME_LENGTH = 200


class InvalidGoalError(ValueError):
    """A goal that no robot can be sent to; the text says why."""


def read_goal(message: Any, use_heading: bool) -> Tuple[Goal, str]:
    """Return the goal in a geometry_msgs/PoseStamped and its frame; an empty frame means the robot's own odometry.

    A quaternion of zeros, as sent by tools that do not care, means no heading. Pure: what passes here leads to no
    command that is not finite, and to no frame name that tf2 or a log line cannot take.
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
            "a goal must be finite, not (%g, %g), and within %g m" % (position.x, position.y, MAX_COORDINATE_M)
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
            "tolerance and timeout must be finite and not negative, not %g m, %g s" % (tolerance_m, timeout_s)
        )


class _Request(NamedTuple):
    """A goal as received."""

    goal: Goal
    frame: str
    """Empty: the robot's own odometry frame."""
    tolerance_m: float
    timeout_s: float
    handle: Any
    """The action's goal handle; None for goals from topics and parameters."""


class GoToGoalServer:
    """Drives one robot to its goals.

    Attributes:
        reached: whether the last goal was reached.
    """

    def __init__(
        self,
        robot: Robot,
        tolerance_m: float = DEFAULT_TOLERANCE_M,
        timeout_s: float = DEFAULT_TIMEOUT_S,
        avoid: bool = False,
    ) -> None:
        """Subscribe to the robot's goal topic and start its action server.

        tolerance_m, timeout_s: of goals that do not give their own. avoid: whether to drive around obstacles that the
        proximity sensors see; otherwise a goal fails before them.
        """
        self.robot = robot
        self.reached = False
        self._tolerance_m, self._timeout_s, self._avoid = tolerance_m, timeout_s, avoid
        self._requests: queue.Queue[_Request] = queue.Queue(MAX_QUEUED_GOALS)
        self._news = threading.Event()
        self._cancelled: Any = None
        self._is_closing = False
        self._distance_m = math.nan
        self._next_feedback_s = 0.0
        self._subscriber = rospy.Subscriber(
            robot.namespace + "/goal", PoseStamped, self._receive_goal, queue_size=1, tcp_nodelay=True
        )
        self._server = actionlib.ActionServer(
            robot.namespace + "/go_to", GoToAction, self._receive_action, self._receive_cancel, auto_start=False
        )
        self._server.start()
        self._thread = threading.Thread(target=self._serve, name="goals", daemon=True)
        self._thread.start()

    # ---------------------------------------------------------------- callbacks, on ROS's threads

    def _receive_goal(self, message: PoseStamped) -> None:
        try:
            goal, frame = read_goal(message, use_heading=True)
        except InvalidGoalError as error:
            self._reject(str(error), None)
        else:
            self.put_goal(goal, frame)

    def _receive_action(self, handle: Any) -> None:
        wanted = handle.get_goal()
        tolerance_m = wanted.tolerance or self._tolerance_m
        timeout_s = wanted.timeout or self._timeout_s
        try:
            goal, frame = read_goal(wanted.target, wanted.use_heading)
            check_limits(tolerance_m, timeout_s)
        except InvalidGoalError as error:
            self._reject(str(error), handle)
        else:
            self._put(_Request(goal, frame, tolerance_m, timeout_s, handle))

    def _receive_cancel(self, handle: Any) -> None:
        self._cancelled = handle
        self._news.set()

    def put_goal(self, goal: Goal, frame: str = "") -> None:
        """Accept a goal with the server's own tolerance and time limit; an empty frame means hero_N/odom."""
        self._put(_Request(goal, frame, self._tolerance_m, self._timeout_s, None))

    def _put(self, request: _Request) -> None:
        try:
            self._requests.put_nowait(request)
        except queue.Full:
            self._reject("more than %d goals at once" % MAX_QUEUED_GOALS, request.handle)
        self._news.set()

    def _reject(self, problem: str, handle: Any) -> None:
        rospy.logerr("%s: goal refused: %s", self.robot.name, problem)
        if handle is not None:
            handle.set_rejected(GoToResult(reason=problem))

    # ---------------------------------------------------------------- the server's thread

    @property
    def busy(self) -> bool:
        """Whether there is a goal to drive to."""
        return self._requests.unfinished_tasks > 0

    def _serve(self) -> None:
        while not self._is_closing:
            self._news.wait()
            self._news.clear()
            while not self._requests.empty():
                self._pursue(self._requests.get())
                self._requests.task_done()

    def _find_interruption(self, handle: Any) -> str:
        """Return why the goal of this handle is to be given up; empty if it is not."""
        if self._is_closing:
            return "the program ends"
        # A goal handle cannot be compared with None.
        if handle is not None and self._cancelled is not None and handle == self._cancelled:
            return "cancelled"
        return "" if self._requests.empty() else "another goal came"

    def _pursue(self, request: _Request) -> None:
        """Drive to a goal, and tell the action's client and the log how it ended."""
        goal, handle = request.goal, request.handle
        start_s = time.monotonic()
        self.reached = False
        self._distance_m = math.nan
        frame = request.frame or "odom"
        if handle is not None:
            handle.set_accepted()
        rospy.loginfo("%s goes to (%.3f, %.3f) in %s", self.robot.name, goal.x_m, goal.y_m, frame)

        def sleep(duration_s: float) -> bool:
            self._news.wait(duration_s)
            self._news.clear()
            return not self._find_interruption(handle)

        def send_feedback(controller: MotionController) -> None:
            self._distance_m = controller.distance_m
            if handle is not None and time.monotonic() >= self._next_feedback_s:
                self._send_feedback(handle, time.monotonic() - start_s)

        reason = interruption = ""
        try:
            # A robot that has yet to join is waited for as long as it then may drive.
            self.robot.wait_until_ready(request.timeout_s, sleep)
            self.robot.pursue(goal, frame, self._avoid, request.timeout_s, request.tolerance_m, sleep, send_feedback)
            self.reached = True
        except HeroError as error:
            interruption = self._find_interruption(handle)
            reason = interruption or str(error)
        elapsed_s = time.monotonic() - start_s
        result = GoToResult(reached=self.reached, distance=self._distance_m, elapsed=elapsed_s, reason=reason)
        if self.reached:
            rospy.loginfo("%s is at its goal after %.1f s, %.3f m off", self.robot.name, elapsed_s, self._distance_m)
            end = handle and handle.set_succeeded
        elif interruption:
            rospy.loginfo("%s gives up its goal: %s", self.robot.name, reason)
            end = handle and handle.set_canceled
        else:
            rospy.logwarn("%s", reason)
            end = handle and handle.set_aborted
        if end:
            end(result, reason)

    def _send_feedback(self, handle: Any, elapsed_s: float) -> None:
        self._next_feedback_s = time.monotonic() + FEEDBACK_PERIOD_S
        feedback = GoToFeedback(distance=self._distance_m, elapsed=elapsed_s)
        if self.robot.fresh_pose() is not None:
            feedback.pose = self.robot.odometry.pose.pose
        handle.publish_feedback(feedback)

    def give_up(self) -> None:
        """End the goal and take no more, at once for many servers; the robot is stopped by the time close() returns."""
        self._is_closing = True
        self._news.set()

    def close(self) -> None:
        """Give up the goal and stop the action server; for the end of the program."""
        self.give_up()
        self._thread.join(CLOSE_TIMEOUT_S)
        self._server.stop()
