"""Serves goals of one robot: the topic /hero_N/goal and the action /hero_N/go_to, one process for any number of robots.

A robot has one goal at a time: a new one, wherever it comes from, replaces the old one. Callbacks only queue requests;
all decisions are made in step(), on the program's own loop.
"""

import math
import queue
from typing import Any, NamedTuple, Optional, Tuple

import actionlib
import rospy
from geometry_msgs.msg import PoseStamped

from hero_msgs.msg import GoToAction, GoToFeedback, GoToResult

from .controllers.go_to_goal import DEFAULT_TOLERANCE_M, Goal, GoToGoalController
from .controllers.motion import DEFAULT_TIMEOUT_S, State
from .errors import FrameError, StoppedError
from .frames import FrameListener, strip_slash
from .geometry import STOP, Pose, transform_pose, yaw_of
from .robot import Robot

__all__ = ["MAX_COORDINATE_M", "GoToGoalServer", "InvalidGoalError", "check_limits", "read_goal"]

FEEDBACK_PERIOD_S = 0.5
"""Between two feedback messages of an action."""

FRAME_TIMEOUT_S = 5.0
"""The frame of a goal may be unknown for so long: listening to /tf begins with the goal, and takes a moment."""

STOP_REPEAT_S = 0.5
"""Stops are sent for so long after a goal; then the server is silent, and other programs may drive the robot."""

MAX_QUEUED_GOALS = 100
"""Goals that callbacks hand to step(); more at once are rejected."""

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
        waiting_for: why a robot that has a goal cannot be driven now, or None.
        reached: whether the last goal was reached.
    """

    def __init__(
        self,
        robot: Robot,
        frames: FrameListener,
        tolerance_m: float = DEFAULT_TOLERANCE_M,
        timeout_s: float = DEFAULT_TIMEOUT_S,
        avoid: bool = False,
    ) -> None:
        """Subscribe to the robot's goal topic and start its action server.

        tolerance_m, timeout_s: of goals that do not give their own. avoid: whether to drive around obstacles that the
        proximity sensors see; otherwise a goal fails before them.
        """
        self.robot = robot
        self.waiting_for: Optional[str] = None
        self.reached = False
        self._frames = frames
        self._tolerance_m, self._timeout_s, self._avoid = tolerance_m, timeout_s, avoid
        self._requests: queue.Queue[_Request] = queue.Queue(MAX_QUEUED_GOALS)
        self._cancelled: queue.Queue[Any] = queue.Queue(MAX_QUEUED_GOALS)
        self._request: Optional[_Request] = None
        self._controller: Optional[GoToGoalController] = None
        self._start_s = self._frame_known_s = self._next_feedback_s = 0.0
        self._silent_from_s = -math.inf
        self._subscriber = rospy.Subscriber(
            robot.namespace + "/goal", PoseStamped, self._receive_goal, queue_size=1, tcp_nodelay=True
        )
        self._server = actionlib.ActionServer(
            robot.namespace + "/go_to", GoToAction, self._receive_action, self._cancelled.put, auto_start=False
        )
        self._server.start()

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

    def put_goal(self, goal: Goal, frame: str = "") -> None:
        """Accept a goal with the server's own tolerance and time limit; an empty frame means hero_N/odom."""
        self._put(_Request(goal, frame, self._tolerance_m, self._timeout_s, None))

    def _put(self, request: _Request) -> None:
        try:
            self._requests.put_nowait(request)
        except queue.Full:
            self._reject("more than %d goals at once" % MAX_QUEUED_GOALS, request.handle)

    def _reject(self, problem: str, handle: Any) -> None:
        rospy.logerr("%s: goal refused: %s", self.robot.name, problem)
        if handle is not None:
            handle.set_rejected(GoToResult(reason=problem))

    # ---------------------------------------------------------------- the program's loop

    @property
    def busy(self) -> bool:
        """Whether there is a goal to drive to."""
        return self._controller is not None or not self._requests.empty()

    @property
    def needs_frames(self) -> bool:
        """Whether the goal is in a frame for which /tf is needed."""
        return self._request is not None and self._request.frame != ""

    def step(self, now_s: float) -> None:
        """Accept new goals, and send the next command if there is one; call it 10 times per second.

        now_s: any clock that never steps back.
        """
        while not self._requests.empty():
            self._begin(self._requests.get(), now_s)
        while not self._cancelled.empty():
            handle = self._cancelled.get()
            if self._request is not None and handle == self._request.handle:
                self._finish(State.FAILED, "cancelled", now_s, cancelled=True)
        self.waiting_for = None
        if self._controller is not None and self._request is not None:
            self.waiting_for = self.robot.missing()
            self._drive(self._request, self._controller, now_s)
        elif now_s < self._silent_from_s:
            self.robot.drive(*STOP)

    def _drive(self, request: _Request, controller: GoToGoalController, now_s: float) -> None:
        """Send the next command towards the goal, or finish it."""
        try:
            self.robot.check_not_stopped()
            pose = self._pose_in_goal_frame(request.frame)
        except StoppedError as error:
            self._finish(State.FAILED, str(error), now_s)
            return
        except FrameError as error:
            # The controller is not asked: it would take this for a robot without odometry.
            self.robot.drive(*STOP)
            if now_s - self._frame_known_s > FRAME_TIMEOUT_S:
                self._finish(State.FAILED, str(error), now_s)
            return
        self._frame_known_s = now_s
        if pose is None and math.isnan(controller.distance_m):
            # A robot that has yet to join is waited for, within the time limit; one that falls silent has failed.
            self.robot.drive(*STOP)
            if now_s - self._start_s > request.timeout_s:
                missing = self.waiting_for or "no odometry"
                self._finish(State.FAILED, "not begun after %g s: %s" % (request.timeout_s, missing), now_s)
            return
        self.robot.drive(*controller.step(pose, self.robot.fresh_proximity(), now_s))
        if controller.state is not State.ACTIVE:
            self._finish(controller.state, controller.reason, now_s)
        elif request.handle is not None and now_s >= self._next_feedback_s:
            self._next_feedback_s = now_s + FEEDBACK_PERIOD_S
            feedback = GoToFeedback(distance=controller.distance_m, elapsed=now_s - self._start_s)
            if self.robot.fresh_pose() is not None:
                feedback.pose = self.robot.odometry.pose.pose
            request.handle.publish_feedback(feedback)

    def _pose_in_goal_frame(self, frame: str) -> Optional[Pose]:
        """Return the robot's pose in the goal's frame, None without odometry. Raises: FrameError without the frame."""
        pose = self.robot.fresh_pose()
        if pose is None or not frame:
            return pose
        return transform_pose(self._frames.origin_of(self.robot.name + "/odom", frame), pose)

    def _begin(self, request: _Request, now_s: float) -> None:
        if self._controller is not None:
            self._finish(State.FAILED, "another goal came", now_s, cancelled=True)
        goal, frame = request.goal, strip_slash(request.frame)
        if frame == self.robot.name + "/odom":
            frame = ""
        self._request = request._replace(frame=frame)
        self._controller = GoToGoalController(goal, now_s, request.tolerance_m, request.timeout_s, self._avoid)
        self._start_s = self._frame_known_s = now_s
        self.reached = False
        if request.handle is not None:
            request.handle.set_accepted()
        rospy.loginfo("%s goes to (%.3f, %.3f) in %s", self.robot.name, goal.x_m, goal.y_m, frame or "odom")

    def _finish(self, state: State, reason: str, now_s: float, cancelled: bool = False) -> None:
        """Stop the robot, and tell the action's client and the log how the goal ended."""
        request, controller = self._request, self._controller
        if request is None or controller is None:
            return
        self._request = self._controller = None
        self._silent_from_s = now_s + STOP_REPEAT_S
        self.reached = state is State.REACHED
        elapsed_s, distance_m = now_s - self._start_s, controller.distance_m
        self.robot.drive(*STOP)
        if self.reached:
            rospy.loginfo("%s is at its goal after %.1f s, %.3f m off", self.robot.name, elapsed_s, distance_m)
        elif cancelled:
            rospy.loginfo("%s gives up its goal: %s", self.robot.name, reason)
        else:
            rospy.logwarn("%s did not reach its goal: %s", self.robot.name, reason)
        if request.handle is None:
            return
        result = GoToResult(reached=self.reached, distance=distance_m, elapsed=elapsed_s, reason=reason)
        if self.reached:
            request.handle.set_succeeded(result)
        elif cancelled:
            request.handle.set_canceled(result, reason)
        else:
            request.handle.set_aborted(result, reason)

    def close(self, now_s: float) -> None:
        """Give up the goal and stop the action server; for the end of the program."""
        self._finish(State.FAILED, "the program ends", now_s, cancelled=True)
        self._server.stop()
