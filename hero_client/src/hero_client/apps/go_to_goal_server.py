"""Serves goals of one robot: the topic /hero_N/goal and the action /hero_N/go_to, one process for any number of robots.

Callbacks only queue requests, because actionlib holds its lock meanwhile; a thread of each server drives the robot.
"""

import threading
from contextlib import contextmanager
from typing import Any, Iterator

import actionlib
import rospy
from geometry_msgs.msg import PoseStamped

from hero_msgs.msg import GoToAction, GoToFeedback, GoToResult

from ..controllers.go_to_goal import DEFAULT_TOLERANCE_M, Goal
from ..controllers.motion import DEFAULT_TIMEOUT_S
from ..robot import Robot
from . import goals

CLOSE_TIMEOUT_S = 1.0
"""Giving up a goal takes 0.2 s."""


class GoToGoalServer(goals.GoalQueue):
    """Drives one robot to its goals; the newest counts, wherever it comes from: see goals.GoalQueue."""

    robot: Robot

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
        super().__init__(robot, avoid)
        self._tolerance_m, self._timeout_s = tolerance_m, timeout_s
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

    # ---------------------------------------------------------------- callbacks, on ROS's threads

    def _receive_goal(self, message: PoseStamped) -> None:
        with self._rejecting():
            self.put_goal(*goals.read_goal(message, use_heading=True))

    def _receive_action(self, handle: Any) -> None:
        wanted = handle.get_goal()
        tolerance_m = wanted.tolerance or self._tolerance_m
        timeout_s = wanted.timeout or self._timeout_s
        with self._rejecting(handle):
            goal, frame = goals.read_goal(wanted.target, wanted.use_heading)
            goals.check_limits(tolerance_m, timeout_s)
            self.put(goals.GoalRequest(goal, frame, tolerance_m, timeout_s, handle))

    def _receive_cancel(self, handle: Any) -> None:
        self.cancel(handle)
        self._news.set()

    def put_goal(self, goal: Goal, frame: str = "") -> None:
        """Accept a goal with the server's own tolerance and time limit; an empty frame means hero_N/odom."""
        with self._rejecting():
            self.put(goals.GoalRequest(goal, frame, self._tolerance_m, self._timeout_s))

    @contextmanager
    def _rejecting(self, handle: Any = None) -> Iterator[None]:
        """Reject a goal that turns out to be invalid, and wake the server's thread."""
        try:
            yield
        except goals.InvalidGoalError as error:
            rospy.logerr("%s: goal refused: %s", self.robot.name, error)
            if handle is not None:
                handle.set_rejected(GoToResult(reason=str(error)))
        self._news.set()

    # ---------------------------------------------------------------- the server's thread

    def _wait(self, duration_s: float = threading.TIMEOUT_MAX) -> None:
        self._news.wait(duration_s)
        self._news.clear()

    def _serve(self) -> None:
        while not self._is_closed:
            self._wait()
            while self.drive_to_next(self._wait):
                continue

    def accept_goal(self, request: goals.GoalRequest) -> None:
        if request.handle is not None:
            request.handle.set_accepted()
        frame = request.frame or "odom"
        self._log("%s goes to (%.3f, %.3f) in %s", self.robot.name, request.goal.x_m, request.goal.y_m, frame)

    def show_progress(self, request: goals.GoalRequest, distance_m: float, elapsed_s: float) -> None:
        if request.handle is not None:
            feedback = GoToFeedback(distance=distance_m, elapsed=elapsed_s)
            if self.robot.fresh_pose() is not None:
                feedback.pose = self.robot.odometry.pose.pose
            request.handle.publish_feedback(feedback)

    def end_goal(self, request: goals.GoalRequest, outcome: goals.GoalOutcome) -> None:
        handle, name = request.handle, self.robot.name
        reached, gave_up, reason, distance_m, elapsed_s = outcome
        # Goals on the topic may come as a stream.
        self._log = rospy.logdebug if reason == goals.REPLACED and handle is None else rospy.loginfo
        if reached:
            rospy.loginfo("%s is at its goal after %.1f s, %.3f m off", name, elapsed_s, distance_m)
            end = handle and handle.set_succeeded
        elif gave_up:
            self._log("%s gives up its goal: %s", name, reason)
            end = handle and handle.set_canceled
        else:
            rospy.logwarn("%s", reason)
            end = handle and handle.set_aborted
        if end:
            end(GoToResult(reached=reached, distance=distance_m, elapsed=elapsed_s, reason=reason), reason)

    def give_up(self) -> None:
        """End the goal and take no more, at once for many servers; the robot is stopped by the time close() returns."""
        super().give_up()
        self._news.set()

    def close(self) -> None:
        """Give up the goal and stop the action server; for the end of the program."""
        self.give_up()
        self._thread.join(CLOSE_TIMEOUT_S)
        self._server.stop()
