"""One robot as an object: methods send commands, properties return the newest data.

    from hero_client import Robot

    with Robot(0) as robot:
        robot.wait_until_ready(timeout_s=10)
        robot.drive(0.1, 0.0, duration_s=2.0)
        print(robot.pose, robot.nearest())

Uses only the topics under /hero_N, the same for simulated and real robots. Units: m, rad, s. Frames (REP 103, 105):
poses are in hero_N/odom, velocities and ranges in hero_N/base_link: x to the front, y to the left, angles
counter-clockwise from the front.
"""

import math
import os
import signal
import sys
import threading
import time
from concurrent.futures import Future
from types import FrameType
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple, Type

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan
from std_msgs.msg import ColorRGBA

from .colors import Color, parse_color
from .command_line import print_error
from .controllers.go_to_goal import (
    DEFAULT_LAW,
    DEFAULT_TIMEOUT_S,
    DEFAULT_TOLERANCE_M,
    Goal,
    GoToGoalController,
    State,
)
from .geometry import Pose, Velocity, clamp, yaw_of
from .readings import Obstacle, find_nearest, front_first
from .robot_constants import MAX_ANGULAR_RAD_S, MAX_LINEAR_M_S
from .ros_node import NodeError, start_ros_node

__all__ = ["GoalError", "Robot", "RobotError", "RobotNotReadyError", "StaleDataError", "start_node", "stop_all"]

STOP_GAP_S = 0.06
"""Between the two messages of a stop: the firmware drops a Twist that comes within 50 ms of the one before."""

SEND_TIME_S = 0.05
"""rospy sends on threads of its own and does not say when it has; this is many times what a send takes."""

REPEAT_PERIOD_S = 0.1
"""Between the commands of a timed drive: well within the robot's watchdog of about 2 s."""

FRESH_ODOM_S = 0.5
"""Odometry comes about 29 times a second; older than this is stale. Wi-Fi gaps of 0.1 s are common."""

FRESH_PROXIMITY_S = 1.0
"""Proximity comes about 5 times a second; older than this is stale."""

LED_PERIOD_S = 2.0
"""Between two messages of the same color: the robot's light goes dark 15 s after the last one."""

Sleep = Callable[[float], bool]
"""Waits for so many seconds and returns whether to continue; `Program.sleep` is one."""

POLL_PERIOD_S = 0.02
"""Between two checks whether a robot is ready."""


class RobotError(Exception):
    """A robot cannot do what it was told; the text says why and what to do."""


class RobotNotReadyError(RobotError):
    """The robot does not take commands or sends no data."""


class StaleDataError(RobotError):
    """The newest message is missing or too old to act upon."""


class GoalError(RobotError):
    """The robot did not reach its goal; the text says why."""


def sleep_unless_shutdown(duration_s: float) -> bool:
    """Wait for duration_s; return whether ROS still runs."""
    time.sleep(duration_s)
    return not rospy.is_shutdown()


def start_node(name: str = "hero_program") -> None:
    """Start a ROS node for a plain script, unless one runs already.

    Ctrl-C raises KeyboardInterrupt as in every Python program, SIGTERM and SIGHUP raise SystemExit: `with` blocks stop
    their robots before ROS shuts down. Without a ROS master, or by a RobotError, the script ends with one line and exit
    code 1.
    """
    if rospy.core.is_initialized():
        return
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, _raise_exit)
        signal.signal(signal.SIGHUP, _raise_exit)
    sys.excepthook = _print_exception
    try:
        start_ros_node(name, anonymous=True)
    except NodeError as error:
        sys.exit("%s: %s" % (os.path.basename(sys.argv[0]), error))


def _print_exception(kind: Type[BaseException], error: BaseException, traceback: Any) -> None:
    """Print a RobotError as one line and Ctrl-C not at all; a mistake in the script keeps its traceback."""
    if issubclass(kind, RobotError):
        print_error(str(error))
    elif not issubclass(kind, KeyboardInterrupt):
        sys.__excepthook__(kind, error, traceback)


def _raise_exit(number: int, frame: Optional[FrameType]) -> None:
    for ending in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(ending, signal.SIG_IGN)  # a second one must not break off the stopping of the robots
    sys.exit(128 + number)


class Robot:
    """One robot by the number in its name: Robot(3) is /hero_3.

    Data properties hand out the newest message only while it is fresh, else they raise StaleDataError. As a context
    manager it stops the robot at the end, also after an error.

    Attributes:
        robot_id, name, namespace: 3, "hero_3", "/hero_3".
        driven: whether a command was sent from here; a robot that was only watched is not stopped at the end.
    """

    def __init__(self, robot_id: int, odom: bool = True, proximity: bool = True) -> None:
        """Connect to the topics of /hero_{robot_id}; odom, proximity: whether to subscribe to these.

        Starts a node if the program has none yet. Returns at once: see wait_until_ready().
        """
        if isinstance(robot_id, bool) or not isinstance(robot_id, int) or robot_id < 0:
            raise ValueError("a robot is named by its number, 0 or more, not by %r" % (robot_id,))
        start_node()
        self.robot_id = robot_id
        self.name = "hero_%d" % robot_id
        self.namespace = "/" + self.name
        self.driven = False
        self._kept_color: Optional[Color] = None
        self._kept_s = -math.inf
        self._newest: Dict[str, Tuple[float, Any]] = {}
        self._cmd_vel = rospy.Publisher(
            self.namespace + "/velocity_controller/cmd_vel", Twist, queue_size=1
        )
        self._led = rospy.Publisher(self.namespace + "/led", ColorRGBA, queue_size=1)
        self._subscribers: Dict[str, rospy.Subscriber] = {}
        if odom:
            self._subscribe("odom", Odometry)
        if proximity:
            self._subscribe("proximity", LaserScan)

    def _subscribe(self, topic: str, message_class: Type[Any]) -> None:
        self._subscribers[topic] = rospy.Subscriber(
            "%s/%s" % (self.namespace, topic),
            message_class,
            self._receive_message,
            callback_args=topic,
            queue_size=1,
            tcp_nodelay=True,
        )

    def _receive_message(self, message: Any, topic: str) -> None:
        self._newest[topic] = (time.monotonic(), message)

    # ------------------------------------------------------------------ data

    def age_s(self, topic: str) -> float:
        """Return the seconds since the last message of "odom" or "proximity" arrived; inf before the first."""
        newest = self._newest.get(topic)
        return math.inf if newest is None else time.monotonic() - newest[0]

    def _read_fresh(self, topic: str, limit_s: float) -> Any:
        newest = self._newest.get(topic)
        if newest is None:
            raise StaleDataError(
                "no message on %s/%s yet: is the robot on, and does the driver run?" % (self.namespace, topic)
            )
        age_s = time.monotonic() - newest[0]
        if age_s > limit_s:
            raise StaleDataError(
                "the last message on %s/%s came %.1f s ago: has the robot gone?" % (self.namespace, topic, age_s)
            )
        return newest[1]

    @property
    def odometry(self) -> Odometry:
        """The newest odometry message. Raises: StaleDataError."""
        return self._read_fresh("odom", FRESH_ODOM_S)

    @property
    def pose(self) -> Pose:
        """Where the robot is, (x_m, y_m, yaw_rad) in the frame hero_N/odom. Raises: StaleDataError."""
        pose = self.odometry.pose.pose
        return Pose(pose.position.x, pose.position.y, yaw_of(pose.orientation))

    @property
    def velocity(self) -> Velocity:
        """How the robot moves by its odometry. Raises: StaleDataError."""
        twist = self.odometry.twist.twist
        return Velocity(twist.linear.x, twist.angular.z)

    @property
    def proximity(self) -> List[float]:
        """Eight ranges in m from the robot's center, front first, counter-clockwise, 45 degrees apart.

        inf: nothing in range (about 0.24 m); 0.0: too close to measure; nan: the sensor gives nothing usable.
        Raises: StaleDataError.
        """
        return front_first(self._read_fresh("proximity", FRESH_PROXIMITY_S))

    def fresh_pose(self) -> Optional[Pose]:
        """Return the pose, or None where `pose` would raise."""
        try:
            return self.pose
        except StaleDataError:
            return None

    def fresh_proximity(self) -> List[float]:
        """Return the ranges, or eight times nan (not known) where `proximity` would raise."""
        try:
            return self.proximity
        except StaleDataError:
            return [math.nan] * 8

    def nearest(self) -> Optional[Obstacle]:
        """Return the nearest obstacle in range, None if there is none. Raises: StaleDataError."""
        ranges = self.proximity
        return find_nearest(ranges, 0.0, math.tau / max(1, len(ranges)))

    @property
    def connected(self) -> bool:
        """Whether the driver subscribes to the robot's commands, as it does while it knows the robot."""
        return self._cmd_vel.get_num_connections() > 0

    def missing(self) -> Optional[str]:
        """Return why the robot cannot be driven now, as text for users; None if it can."""
        if not self.connected:
            return "nobody takes %s: is the driver running, and has the robot joined it?" % self._cmd_vel.name
        for topic in self._subscribers:
            if self.age_s(topic) > FRESH_PROXIMITY_S:
                return "nothing comes on %s/%s: is the robot on and in reach?" % (self.namespace, topic)
        return None

    def wait_until_ready(self, timeout_s: float = 10.0, sleep: Sleep = sleep_unless_shutdown) -> "Robot":
        """Wait until the robot takes commands and sends what was subscribed to; return the robot itself.

        Raises: RobotNotReadyError after timeout_s, saying what is missing.
        """
        deadline_s = time.monotonic() + timeout_s
        while True:
            missing = self.missing()
            if missing is None:
                return self
            if time.monotonic() >= deadline_s or not sleep(POLL_PERIOD_S):
                raise RobotNotReadyError("%s is not ready after %g s: %s" % (self.name, timeout_s, missing))

    # ------------------------------------------------------------------ commands

    def drive(self, linear_m_s: float, angular_rad_s: float, duration_s: Optional[float] = None) -> None:
        """Drive with these velocities, limited to 0.20 m/s and 8 rad/s.

        linear_m_s: positive forward. angular_rad_s: positive to the left. duration_s: drive for this time, then stop;
        None sends one command and returns: the robot obeys it until the next one, for about two seconds at most.
        Raises: ValueError for velocities that are not finite.
        """
        if duration_s is None:
            self._send_twist(linear_m_s, angular_rad_s)
            return
        end_s = time.monotonic() + duration_s
        try:
            while not rospy.is_shutdown():
                remaining_s = end_s - time.monotonic()
                if remaining_s <= 0.0:
                    break
                self._send_twist(linear_m_s, angular_rad_s)
                time.sleep(min(REPEAT_PERIOD_S, remaining_s))
        finally:
            self.stop()

    def _send_twist(self, linear_m_s: float, angular_rad_s: float) -> None:
        if not (math.isfinite(linear_m_s) and math.isfinite(angular_rad_s)):
            raise ValueError("speeds must be finite, not %r m/s and %r rad/s" % (linear_m_s, angular_rad_s))
        self.driven = True
        twist = Twist()
        twist.linear.x = clamp(linear_m_s, MAX_LINEAR_M_S)
        twist.angular.z = clamp(angular_rad_s, MAX_ANGULAR_RAD_S)
        if not rospy.is_shutdown():
            self._cmd_vel.publish(twist)

    def stop(self) -> None:
        """Send two stops, further apart than the robot's filter; returns once they are sent, after 0.11 s."""
        stop_all([self])

    def go_to(
        self,
        x_m: float,
        y_m: float,
        yaw_rad: Optional[float] = None,
        timeout_s: float = DEFAULT_TIMEOUT_S,
        tolerance_m: float = DEFAULT_TOLERANCE_M,
        law: str = DEFAULT_LAW,
        avoid: bool = False,
        sleep: Sleep = sleep_unless_shutdown,
    ) -> None:
        """Drive to a position in hero_N/odom, turn to yaw_rad if given, and return when the robot has stopped there.

        law: see controllers.go_to_goal.LAWS. avoid: go around what the proximity sensors see.
        Raises: GoalError with the reason if it is not reached; the robot is stopped then, too.
        """
        controller = GoToGoalController(Goal(x_m, y_m, yaw_rad), time.monotonic(), tolerance_m, timeout_s, law)
        try:
            while controller.state is State.ACTIVE:
                ranges = self.fresh_proximity() if avoid else None
                self.drive(*controller.step(self.fresh_pose(), ranges, time.monotonic()))
                if not sleep(REPEAT_PERIOD_S):
                    raise GoalError("%s did not reach its goal: the program ends" % self.name)
        finally:
            self.stop()
        if controller.state is State.FAILED:
            raise GoalError("%s did not reach (%g, %g): %s" % (self.name, x_m, y_m, controller.reason))

    def start_go_to(self, x_m: float, y_m: float, **options: Any) -> "Future[None]":
        """Start go_to() on another thread; the future is done, or holds the GoalError, when it ends.

        Several robots at once: start all, then ask each future for its result().
        """
        future: Future[None] = Future()
        future.set_running_or_notify_cancel()
        thread = threading.Thread(target=self._finish_go_to, args=(future, x_m, y_m, options), daemon=True)
        thread.start()
        return future

    def _finish_go_to(self, future: "Future[None]", x_m: float, y_m: float, options: Dict[str, Any]) -> None:
        try:
            self.go_to(x_m, y_m, **options)
        except (RobotError, ValueError, TypeError, rospy.ROSException) as error:
            future.set_exception(error)
        else:
            future.set_result(None)

    def led(self, color: Color) -> None:
        """Show a color: a name of colors.COLORS, or (red, green, blue) each 0..1. The robot goes dark 15 s later."""
        red, green, blue = parse_color(color)
        if not rospy.is_shutdown():
            self._led.publish(ColorRGBA(red, green, blue, 1.0))

    def keep_led(self, color: Color) -> None:
        """As led(), for every step of a loop: sends a change at once, and else repeats the color every 2 s."""
        now_s = time.monotonic()
        if color != self._kept_color or now_s - self._kept_s >= LED_PERIOD_S:
            self._kept_color, self._kept_s = color, now_s
            self.led(color)

    # ------------------------------------------------------------------ end

    def close(self) -> None:
        """Stop the robot, if it was driven from here, and leave its topics; safe twice."""
        self._stop_if_driven()
        self._disconnect()

    def _stop_if_driven(self) -> None:
        stop_all([self] if self.driven else [])

    def _disconnect(self) -> None:
        for subscriber in self._subscribers.values():
            subscriber.unregister()
        self._subscribers = {}

    def __enter__(self) -> "Robot":
        return self

    def __exit__(self, *error: object) -> None:
        # Topics are left to the end of the program: leaving them one by one takes 20 ms each.
        self._stop_if_driven()

    def __repr__(self) -> str:
        return "Robot(%d)" % self.robot_id


def stop_all(robots: Sequence[Robot]) -> None:
    """Send every robot two stops, far enough apart that none is dropped, and wait until they are sent."""
    if not robots:
        return
    for robot in robots:
        robot._send_twist(0.0, 0.0)
    # The first stop may itself come within 50 ms of the last command, and then only the second one counts.
    time.sleep(STOP_GAP_S)
    for robot in robots:
        robot._send_twist(0.0, 0.0)
    time.sleep(SEND_TIME_S)
