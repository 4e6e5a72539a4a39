"""Serves goals of one robot: the topic /hero_N/goal and the action /hero_N/go_to, one process for any number of robots.

A new goal in the same frame turns the robot on its way, without a stop: goals may come as a stream. Only the newest of
those that wait is driven to. Callbacks only queue requests, because actionlib holds its lock meanwhile; a thread of
each server drives the robot.
"""

import math
import queue
import threading
from contextlib import contextmanager
from typing import Any, Callable, Iterator, NamedTuple, Tuple

import actionlib
import rospy
from geometry_msgs.msg import PoseStamped

from hero_msgs.msg import GoToAction, GoToFeedback, GoToResult
from hero_node import HeroError, yaw_of
from hero_node.parameters import MAX_COORDINATE_M

from ..controllers.go_to_goal import DEFAULT_TOLERANCE_M, Goal, GoToGoalController
from ..controllers.motion import DEFAULT_TIMEOUT_S, State
from ..robot import Robot

FEEDBACK_PERIOD_S = 0.5
CLOSE_TIMEOUT_S = 1.0
"""Giving up a goal takes 0.2 s."""

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
    that is not finite, and to no frame name that tf2 or a log line cannot take. Raises: InvalidGoalError.
    """
    frame = message.header.frame_id
    if not frame.isprintable() or len(frame) > MAX_FRAME_LENGTH:
        text = "frame_id must be up to %d printable characters, not %s"
        raise InvalidGoalError(text % (MAX_FRAME_LENGTH, ascii(frame[:40])))
    position, orientation = message.pose.position, message.pose.orientation
    if not (abs(position.x) <= MAX_COORDINATE_M and abs(position.y) <= MAX_COORDINATE_M):
        text = f"a goal must be finite, not ({position.x:g}, {position.y:g}), and within {MAX_COORDINATE_M:g} m"
        raise InvalidGoalError(text)
    if not use_heading:
        return Goal(position.x, position.y), frame
    entries = (orientation.x, orientation.y, orientation.z, orientation.w)
    if not all(abs(entry) <= MAX_QUATERNION_ENTRY for entry in entries):
        raise InvalidGoalError("the goal's orientation is no quaternion: (%g, %g, %g, %g)" % entries)
    known = sum(abs(entry) for entry in entries) > 1e-6
    return Goal(position.x, position.y, yaw_of(orientation) if known else None), frame


class GoalRequest(NamedTuple):
    """A goal as received from the action, a topic or parameters; checked."""

    goal: Goal
    frame: str
    """Empty: the robot's own odometry frame."""
    tolerance_m: float
    timeout_s: float
    handle: Any = None
    """The action's goal handle; None for goals from topics and parameters."""


class GoToGoalServer:
    """Drives one robot to its goals, which may come from any thread; the newest counts, wherever it comes from.

    Attributes:
        robot: the robot.
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
        self._requests: queue.Queue[GoalRequest] = queue.Queue()
        self._cancelled: Any = None
        self._is_closed = False
        self._news = threading.Event()
        self._log = rospy.loginfo
        self._subscriber = rospy.Subscriber(
            robot.namespace + "/goal", PoseStamped, self._receive_goal, queue_size=1, tcp_nodelay=True
        )
        self._server = actionlib.ActionServer(
            robot.namespace + "/go_to", GoToAction, self._receive_action, self._receive_cancel, auto_start=False
        )
        self._server.start()
        self._thread = threading.Thread(target=self._serve, name="goals", daemon=True)
        self._thread.start()

    @property
    def busy(self) -> bool:
        """Return whether there is a goal to drive to."""
        return self._requests.unfinished_tasks > 0

    def _receive_goal(self, message: PoseStamped) -> None:
        with self._rejecting():
            self.put_goal(*read_goal(message, use_heading=True))

    def _receive_action(self, handle: Any) -> None:
        wanted = handle.get_goal()
        tolerance_m = wanted.tolerance or self._tolerance_m
        timeout_s = wanted.timeout or self._timeout_s
        with self._rejecting(handle):
            goal, frame = read_goal(wanted.target, wanted.use_heading)
            if not (0.0 < tolerance_m < math.inf and 0.0 < timeout_s < math.inf):
                text = "tolerance and timeout must be finite and not negative, not %g m, %g s"
                raise InvalidGoalError(text % (tolerance_m, timeout_s))
            self._requests.put(GoalRequest(goal, frame, tolerance_m, timeout_s, handle))

    def _receive_cancel(self, handle: Any) -> None:
        self._cancelled = handle
        self._news.set()

    def put_goal(self, goal: Goal, frame: str = "") -> None:
        """Accept a goal with the server's own tolerance and time limit; an empty frame means hero_N/odom."""
        self._requests.put(GoalRequest(goal, frame, self._tolerance_m, self._timeout_s))
        self._news.set()

    @contextmanager
    def _rejecting(self, handle: Any = None) -> Iterator[None]:
        """Reject a goal that turns out to be invalid, and wake the server's thread."""
        try:
            yield
        except InvalidGoalError as error:
            rospy.logerr("%s: goal refused: %s", self.robot.name, error)
            if handle is not None:
                handle.set_rejected(GoToResult(reason=str(error)))
        self._news.set()

    def _wait(self, duration_s: float = threading.TIMEOUT_MAX) -> None:
        self._news.wait(duration_s)
        self._news.clear()

    def _serve(self) -> None:
        while not self._is_closed:
            self._wait()
            while self._drive_to_next(self._wait):
                continue

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
            self._end(request, REPLACED, True, math.nan, 0.0)
            request = self._requests.get()
        return request

    def _drive_to_next(self, wait: Callable[[float], object]) -> bool:
        """Drive to the next goal until it is reached, fails or is given up; return whether there was one.

        wait: waits for this many seconds, or less if there is news.
        """
        if self._is_closed or self._requests.empty():
            return False
        request = self._take_newest()
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
                self._end(request, REPLACED, True, distance_m, now_s - start_s)
                request, start_s = self._take_newest(), now_s
                controller.change_goal(request.goal, request.tolerance_m, request.timeout_s, now_s)
                self._accept(request)
            if now_s >= next_feedback_s:
                next_feedback_s = now_s + FEEDBACK_PERIOD_S
                self._show_progress(request, distance_m, now_s - start_s)

        self._accept(request)
        reason = interruption = ""
        try:
            # A robot that has yet to join is waited for as long as it then may drive.
            self.robot.wait_until_ready(request.timeout_s, sleep)
            frame = request.frame or "odom"
            limits = request.timeout_s, request.tolerance_m
            self.robot.go_to(*request.goal, frame, self._avoid, *limits, sleep, on_step)
        except HeroError as error:
            interruption = self._find_interruption(request.handle)
            reason = interruption or str(error)
        self.reached = not reason
        self._end(request, reason, bool(interruption), distance_m, self.robot.now_s - start_s)
        return True

    def _accept(self, request: GoalRequest) -> None:
        if request.handle is not None:
            request.handle.set_accepted()
        frame = request.frame or "odom"
        self._log("%s goes to (%.3f, %.3f) in %s", self.robot.name, request.goal.x_m, request.goal.y_m, frame)

    def _show_progress(self, request: GoalRequest, distance_m: float, elapsed_s: float) -> None:
        if request.handle is not None:
            feedback = GoToFeedback(distance=distance_m, elapsed=elapsed_s)
            if self.robot.fresh_pose() is not None:
                feedback.pose = self.robot.odometry.pose.pose
            request.handle.publish_feedback(feedback)

    def _end(self, request: GoalRequest, reason: str, gave_up: bool, distance_m: float, elapsed_s: float) -> None:
        """End a goal, which was reached unless there is a reason why not; giving one up is no failure of the robot."""
        handle, name = request.handle, self.robot.name
        # Goals on the topic may come as a stream.
        self._log = rospy.logdebug if reason == REPLACED and handle is None else rospy.loginfo
        if not reason:
            rospy.loginfo("%s is at its goal after %.1f s, %.3f m off", name, elapsed_s, distance_m)
            end = handle and handle.set_succeeded
        elif gave_up:
            self._log("%s gives up its goal: %s", name, reason)
            end = handle and handle.set_canceled
        else:
            rospy.logwarn("%s", reason)
            end = handle and handle.set_aborted
        if end:
            end(GoToResult(reached=not reason, distance=distance_m, elapsed=elapsed_s, reason=reason), reason)
        self._requests.task_done()

    def give_up(self) -> None:
        """End the goal and take no more, at once for many servers; the robot is stopped by the time close() returns."""
        self._is_closed = True
        self._news.set()

    def close(self) -> None:
        """Give up the goal and stop the action server; for the end of the program."""
        self.give_up()
        self._thread.join(CLOSE_TIMEOUT_S)
        self._server.stop()
