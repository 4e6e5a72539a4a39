"""Node go_to_goal: goals from parameters, topics and actions -> commands that bring robots there, one process for all.

A robot has one goal at a time: a new one, wherever it comes from, takes the place of the old one.
"""

import math
import queue
import sys
import time
from typing import Any, Dict, List, NamedTuple, Optional

import actionlib
import rospy
from geometry_msgs.msg import PoseStamped

from hero_client.control_laws import STANDSTILL, Pose
from hero_client.frame_watch import FrameError, FrameWatch, plain_frame, shift_pose
from hero_client.goal_pursuit import (
    DEFAULT_LAW,
    DEFAULT_TIMEOUT_S,
    DEFAULT_TOLERANCE_M,
    LAWS,
    Goal,
    GoalPursuit,
    State,
)
from hero_client.goal_reading import LARGEST_M, GoalError, check_limits, read_goal
from hero_client.program import (
    Program,
    ProgramError,
    check_flag,
    check_number,
    parse_robot_ids,
    read_parameters,
    run,
)
from hero_client.robot import Robot
from hero_client.swarm import Swarm
from hero_client.swarm_start import WaitReport, open_swarm
from hero_msgs.msg import GoToAction, GoToFeedback, GoToResult

RATE_HZ = 10.0

FEEDBACK_PERIOD_S = 0.5
"""Between two feedback messages of an action."""

FRAME_TIMEOUT_S = 5.0
"""So long the frame of a goal may be unknown: listening to /tf begins with the goal, and takes a moment."""

STOP_REPEAT_S = 0.5
"""Standstill is sent for so long after a goal, then the node is silent and other programs may drive the robot."""

MAX_WAITING_GOALS = 100
"""Goals that callbacks hand to the loop; more at once are refused, which nobody does on purpose."""


class Parameters(NamedTuple):
    """The checked parameters of the node."""

    robot_ids: Optional[List[int]]
    goals: Dict[int, Goal]
    frame: str
    tolerance_m: float
    timeout_s: float
    law: str
    avoid: bool
    once: bool


def load_parameters() -> Parameters:
    """Return the node's private parameters. Raises: ProgramError."""
    given = read_parameters(
        {
            "robots": "0",
            "goals": "",
            "frame": "",
            "tolerance_m": DEFAULT_TOLERANCE_M,
            "timeout_s": DEFAULT_TIMEOUT_S,
            "law": DEFAULT_LAW,
            "avoid": False,
            "once": False,
        }
    )
    if given["law"] not in LAWS:
        raise ProgramError("~law is %r, but must be one of: %s" % (given["law"], ", ".join(LAWS)))
    robot_ids = parse_robot_ids("robots", given["robots"])
    goals = parse_goals(given["goals"], robot_ids)
    once = check_flag("once", given["once"])
    if once and not goals:
        raise ProgramError("~once is true, but ~goals is empty: there is nothing to do")
    return Parameters(
        robot_ids,
        goals,
        plain_frame(str(given["frame"])),
        check_number("tolerance_m", given["tolerance_m"], 0.002, 1.0, "m"),
        check_number("timeout_s", given["timeout_s"], 1.0, 3600.0, "s"),
        given["law"],
        check_flag("avoid", given["avoid"]),
        once,
    )


def parse_goals(text: Any, robot_ids: Optional[List[int]]) -> Dict[int, Goal]:
    """Return the goals in text such as "0.5 0.2; 0.3 0.1 90": x y in m, heading in degrees, in the order of the ids.

    Raises: ProgramError for anything else.
    """
    remedy = '"x y" or "x y heading" for each robot, in m and degrees, apart by ";"'
    parts = [part.split() for part in str(text).split(";") if part.strip()]
    if not parts:
        return {}
    if robot_ids is None or len(parts) != len(robot_ids):
        count = "all" if robot_ids is None else str(len(robot_ids))
        raise ProgramError("~goals has %d goals for %s robots; it must hold %s" % (len(parts), count, remedy))
    goals: Dict[int, Goal] = {}
    for robot_id, part in zip(robot_ids, parts):
        try:
            numbers = [float(word) for word in part]
        except ValueError:
            numbers = []
        if len(numbers) not in (2, 3) or not all(abs(number) <= LARGEST_M for number in numbers):
            raise ProgramError("~goals holds %r, but must hold %s" % (" ".join(part), remedy))
        yaw_rad = math.radians(numbers[2]) if len(numbers) == 3 else None
        goals[robot_id] = Goal(numbers[0], numbers[1], yaw_rad)
    return goals


class Order(NamedTuple):
    """A goal as somebody gave it."""

    goal: Goal
    frame: str
    """Empty: the robot's own odometry frame."""
    tolerance_m: float
    timeout_s: float
    handle: Any
    """The action's goal handle; None for goals from topics and parameters."""


class Pilot:
    """Brings one robot to its goals. Callbacks put orders into a queue; step() runs on the node's loop."""

    def __init__(self, robot: Robot, parameters: Parameters, frames: FrameWatch) -> None:
        """Listen on the robot's goal topic and action."""
        self.robot = robot
        self.waiting_for: Optional[str] = None
        self.last_state = State.ACTIVE
        self._parameters = parameters
        self._frames = frames
        self._orders: queue.Queue[Order] = queue.Queue(MAX_WAITING_GOALS)
        self._order: Optional[Order] = None
        self._pursuit: Optional[GoalPursuit] = None
        self._start_s = 0.0
        self._next_feedback_s = 0.0
        self._quiet_from_s = -math.inf
        self._frame_known_s = 0.0
        self._subscriber = rospy.Subscriber(
            robot.namespace + "/goal", PoseStamped, self._receive_goal, queue_size=1, tcp_nodelay=True
        )
        self._server = actionlib.ActionServer(
            robot.namespace + "/go_to", GoToAction, self._receive_action, self._receive_cancel, auto_start=False
        )
        self._cancelled: queue.Queue[Any] = queue.Queue(MAX_WAITING_GOALS)
        self._server.start()

    # ---------------------------------------------------------------- callbacks, on ROS's threads

    def _receive_goal(self, message: PoseStamped) -> None:
        try:
            goal, frame = read_goal(message, use_heading=True)
        except GoalError as error:
            self._refuse(str(error), None)
        else:
            self.put_goal(goal, frame)

    def _receive_action(self, handle: Any) -> None:
        wanted = handle.get_goal()
        tolerance_m = wanted.tolerance or self._parameters.tolerance_m
        timeout_s = wanted.timeout or self._parameters.timeout_s
        try:
            goal, frame = read_goal(wanted.target, wanted.use_heading)
            check_limits(tolerance_m, timeout_s)
        except GoalError as error:
            self._refuse(str(error), handle)
        else:
            self._put(Order(goal, frame, tolerance_m, timeout_s, handle))

    def _receive_cancel(self, handle: Any) -> None:
        self._cancelled.put(handle)

    def put_goal(self, goal: Goal, frame: str) -> None:
        """Take a goal with the node's own tolerance and time limit."""
        self._put(Order(goal, frame, self._parameters.tolerance_m, self._parameters.timeout_s, None))

    def _put(self, order: Order) -> None:
        try:
            self._orders.put_nowait(order)
        except queue.Full:
            self._refuse("more than %d goals at once" % MAX_WAITING_GOALS, order.handle)

    def _refuse(self, problem: str, handle: Any) -> None:
        rospy.logerr("%s: goal refused: %s", self.robot.name, problem)
        if handle is not None:
            handle.set_rejected(GoToResult(reason=problem))

    # ---------------------------------------------------------------- the node's loop

    @property
    def busy(self) -> bool:
        """Whether there is a goal to go to."""
        return self._pursuit is not None or not self._orders.empty()

    @property
    def needs_frames(self) -> bool:
        """Whether the goal is in a frame for which /tf is needed."""
        return self._order is not None and self._order.frame != ""

    def step(self, now_s: float) -> None:
        """Take new orders, and send the next command if there is a goal."""
        while not self._orders.empty():
            self._begin(self._orders.get(), now_s)
        while not self._cancelled.empty():
            handle = self._cancelled.get()
            if self._order is not None and handle == self._order.handle:
                self._finish(State.FAILED, "cancelled", now_s, cancelled=True)
        self.waiting_for = self.robot.missing() if self._pursuit is not None else None
        if self._pursuit is None or self._order is None:
            if now_s < self._quiet_from_s:
                self.robot.drive(*STANDSTILL)
            return
        ranges = self.robot.fresh_proximity() if self._parameters.avoid else None
        try:
            pose = self._pose_in_goal_frame()
        except FrameError as error:
            # The robot stands, and the pursuit is not asked: it would take this for a robot without odometry.
            self.robot.drive(*STANDSTILL)
            if now_s - self._frame_known_s > FRAME_TIMEOUT_S:
                self._finish(State.FAILED, str(error), now_s)
            return
        self._frame_known_s = now_s
        if pose is None and math.isnan(self._pursuit.distance_m):
            # A robot that has yet to join is waited for, within the time limit; one that falls silent has failed.
            self.robot.drive(*STANDSTILL)
            if now_s - self._start_s > self._order.timeout_s:
                missing = self.waiting_for or "no odometry"
                self._finish(State.FAILED, "not begun after %g s: %s" % (self._order.timeout_s, missing), now_s)
            return
        self.robot.drive(*self._pursuit.step(pose, ranges, now_s))
        if self._pursuit.state is not State.ACTIVE:
            self._finish(self._pursuit.state, self._pursuit.reason, now_s)
        elif self._order.handle is not None and now_s >= self._next_feedback_s:
            self._next_feedback_s = now_s + FEEDBACK_PERIOD_S
            self._order.handle.publish_feedback(self._make_feedback(now_s))

    def _pose_in_goal_frame(self) -> Optional[Pose]:
        """Return the robot's pose in the goal's frame, None without odometry. Raises: FrameError without the frame."""
        pose = self.robot.fresh_pose()
        if pose is None or self._order is None or not self._order.frame:
            return pose
        return shift_pose(self._frames.origin_of(self.robot.name + "/odom", self._order.frame), pose)

    def _begin(self, order: Order, now_s: float) -> None:
        if self._pursuit is not None:
            self._finish(State.FAILED, "another goal came", now_s, cancelled=True)
        frame = plain_frame(order.frame)
        if frame == self.robot.name + "/odom":
            frame = ""
        self._order = order._replace(frame=frame)
        self._pursuit = GoalPursuit(order.goal, now_s, order.tolerance_m, order.timeout_s, self._parameters.law)
        self._start_s = self._frame_known_s = now_s
        self.last_state = State.ACTIVE
        if order.handle is not None:
            order.handle.set_accepted()
        rospy.loginfo("%s goes to (%.3f, %.3f) in %s", self.robot.name, order.goal.x_m, order.goal.y_m, frame or "odom")

    def _finish(self, state: State, reason: str, now_s: float, cancelled: bool = False) -> None:
        """End the pursuit, tell whoever ordered it, and let the robot stand."""
        order, pursuit = self._order, self._pursuit
        if order is None or pursuit is None:
            return
        self._order = self._pursuit = None
        self._quiet_from_s = now_s + STOP_REPEAT_S
        self.last_state = state
        elapsed_s = now_s - self._start_s
        self.robot.drive(*STANDSTILL)
        if state is State.REACHED:
            rospy.loginfo("%s is at its goal after %.1f s, %.3f m off", self.robot.name, elapsed_s, pursuit.distance_m)
        elif cancelled:
            rospy.loginfo("%s gives up its goal: %s", self.robot.name, reason)
        else:
            rospy.logwarn("%s did not reach its goal: %s", self.robot.name, reason)
        if order.handle is None:
            return
        result = GoToResult(
            reached=state is State.REACHED, distance=pursuit.distance_m, elapsed=elapsed_s, reason=reason
        )
        if state is State.REACHED:
            order.handle.set_succeeded(result)
        elif cancelled:
            order.handle.set_canceled(result, reason)
        else:
            order.handle.set_aborted(result, reason)

    def _make_feedback(self, now_s: float) -> GoToFeedback:
        feedback = GoToFeedback(distance=math.nan, elapsed=now_s - self._start_s)
        if self._pursuit is not None:
            feedback.distance = self._pursuit.distance_m
        if self.robot.fresh_pose() is not None:
            feedback.pose = self.robot.odometry.pose.pose
        return feedback

    def close(self, now_s: float) -> None:
        """Give up the goal, and end the action's own thread, as the program ends."""
        self._finish(State.FAILED, "the program ends", now_s, cancelled=True)
        self._server.stop()


def pilot_swarm(program: Program, parameters: Parameters, swarm: Swarm) -> bool:
    """Bring robots to goals; see run_pilots()."""
    frames = FrameWatch()
    pilots = [Pilot(robot, parameters, frames) for robot in swarm]
    for pilot in pilots:
        if pilot.robot.robot_id in parameters.goals:
            pilot.put_goal(parameters.goals[pilot.robot.robot_id], parameters.frame)
    rospy.loginfo("awaiting goals on %s", ", ".join(pilot.robot.namespace + "/goal" for pilot in pilots))
    try:
        return run_pilots(program, parameters, pilots, frames)
    finally:
        for pilot in pilots:
            pilot.close(time.monotonic())


def run_pilots(program: Program, parameters: Parameters, pilots: List[Pilot], frames: FrameWatch) -> bool:
    """Step all pilots until the program is to end, or once all are there; return whether all were reached."""
    report = WaitReport()
    while program.pace(1.0 / RATE_HZ):
        now_s = time.monotonic()
        for pilot in pilots:
            pilot.step(now_s)
        report.update({pilot.robot.name: pilot.waiting_for for pilot in pilots})
        if not any(pilot.needs_frames for pilot in pilots):
            frames.close()
        if parameters.once and not any(pilot.busy for pilot in pilots):
            return all(pilot.last_state is State.REACHED for pilot in pilots)
    return not parameters.once


def _main() -> None:
    with Program("go_to_goal") as program:
        parameters = load_parameters()
        with open_swarm(program, parameters.robot_ids, proximity=parameters.avoid) as swarm:
            reached = pilot_swarm(program, parameters, swarm)
        if not reached:
            sys.exit(1)


def main() -> None:
    """Run the node."""
    run(_main)
