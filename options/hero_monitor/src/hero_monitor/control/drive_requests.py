"""Carries out what pages request: stops, velocities and goals.

A stop is published at once, on topics that are open since the driver was found: no lock and no queue delays it. Topics
for driving are opened, and goals sent, in the background.
"""

import math
import time
from typing import Dict, Optional, Tuple

import rospy
from geometry_msgs.msg import PoseStamped, Twist

from hero_client.ros import Drivers
from hero_client.values import SEND_TIME_S
from hero_node import NodeError, Pose
from hero_node.ros import ask_master

from ..background import Background
from .dead_man import DeadMan
from .requests import read_clock_ms

LISTENER_TIMEOUT_S = 2.0
"""To connect to a driver or a program that takes goals; about 0.1 s is usual."""

STOP_PERIOD_S = 0.06


class DriveRequests:
    """Commands of pages to robots. All methods return at once, except send_goal().

    Attributes:
        dead_man: stops robots; step() sends what it takes.
        stopped_ms: when a page last stopped all robots, on the pages' clock; None before.
    """

    def __init__(self, drivers: Drivers, background: Background) -> None:
        self._drivers = drivers
        self._background = background
        self.dead_man = DeadMan()
        self._velocities: Dict[str, Optional[rospy.Publisher]] = {}
        self._goals: Dict[str, rospy.Publisher] = {}
        self.stopped_ms: Optional[int] = None

    def drive(self, page: int, robot: str, linear_m_s: float, angular_rad_s: float) -> bool:
        """Drive a robot for HOLD_TIMEOUT_S; return False if another page drives it."""
        if not self.dead_man.hold(page, robot, time.monotonic()):
            return False
        self._publish(robot, linear_m_s, angular_rad_s)
        return True

    def prepare(self, robot: str) -> None:
        """Open a robot's topic, which takes a moment."""
        if robot not in self._velocities:
            self._velocities[robot] = None
            self._background.submit(self._open_velocity, robot)

    def step(self) -> None:
        """Send the stops that are due; to be called every STOP_PERIOD_S."""
        for robot in self.dead_man.take_stops(time.monotonic()):
            if not self._publish(robot, 0.0, 0.0):
                self.dead_man.stop(robot)

    def _publish(self, robot: str, linear_m_s: float, angular_rad_s: float) -> bool:
        """Send a velocity; return False while the topic is being opened."""
        publisher = self._velocities.get(robot)
        if publisher is not None:
            message = Twist()
            message.linear.x, message.angular.z = linear_m_s, angular_rad_s
            publisher.publish(message)
        else:
            self.prepare(robot)
        return publisher is not None

    def _open_velocity(self, robot: str) -> None:
        topic = f"/{robot}/velocity_controller/cmd_vel"
        publisher = rospy.Publisher(topic, Twist, queue_size=1, tcp_nodelay=True)
        # A stop is sent once: it must not be lost before the driver is connected.
        _wait_for_connections(publisher, 1)
        self._velocities[robot] = publisher

    def send_goal(self, robot: str, frame: str, goal: Pose, with_heading: bool) -> Tuple[str, str]:
        """Send a goal in a frame to the program that takes goals for this robot; may take seconds.

        Return level (info, warn, error) and text for the users of a page.
        """
        topic = f"/{robot}/goal"
        try:
            if not self._has_listener(topic):
                launch = f"roslaunch hero_examples go_to_goal.launch robots:={robot.rpartition('_')[2]}"
                return "error", f"no program takes goals for {robot}: start one here, or {launch}"
        except NodeError as error:
            return "error", str(error)
        message = PoseStamped()
        message.header.stamp = rospy.Time.now()
        message.header.frame_id = frame
        message.pose.position.x, message.pose.position.y = goal.x_m, goal.y_m
        if with_heading:
            message.pose.orientation.z = math.sin(goal.yaw_rad / 2.0)
            message.pose.orientation.w = math.cos(goal.yaw_rad / 2.0)
        self._goals[topic].publish(message)
        return "info", f"{robot} has a new goal"

    def _has_listener(self, topic: str) -> bool:
        """Return whether another node subscribes to a topic, as soon as it is connected."""
        _, subscribed, _ = ask_master("getSystemState")
        others = set(dict(subscribed).get(topic, [])) - {rospy.get_name()}
        if not others:
            return False
        if topic not in self._goals:
            # Not latched: a program that starts later must not find an old goal.
            self._goals[topic] = rospy.Publisher(topic, PoseStamped, queue_size=2, tcp_nodelay=True)
        # This node subscribes too, to show goals, and counts.
        _wait_for_connections(self._goals[topic], len(others) + 1)
        return True

    def request_stop(self, stop: bool) -> None:
        """Ask all drivers to stop all robots, or to release them."""
        self._drivers.request_stop(stop)
        now_ms = read_clock_ms()
        if stop:
            self.stopped_ms = now_ms
        self.dead_man.end_all_holds(now_ms)
        self.step()

    def may_drive(self) -> bool:
        """Return whether pages may drive robots: not while robots are being stopped or released."""
        status = self._drivers.stop_status()
        return status is None or status.is_final

    def close(self) -> None:
        """Stop all robots that pages drive."""
        self.dead_man.drop_all()
        self.step()
        time.sleep(SEND_TIME_S)


def _wait_for_connections(publisher: rospy.Publisher, count: int) -> None:
    deadline_s = time.monotonic() + LISTENER_TIMEOUT_S
    while publisher.get_num_connections() < count and time.monotonic() < deadline_s:
        time.sleep(0.02)
