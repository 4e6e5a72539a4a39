"""Carries out what pages ask for: stops, velocities and goals.

Nothing here waits on the caller's thread: topics are opened and goals handed over on a thread of their own, and the
outcome is told later in words. A stop is published at once, on topics that are open since the driver was found.
"""

import math
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Callable, Dict, Optional

import rosgraph
import rospy
from geometry_msgs.msg import PoseStamped, Twist

from hero_client.drivers import Drivers
from hero_client.fleet_state import Pose

from .dead_man import STOPS, DeadMan, Velocity

GOALS_AT_ONCE = 20
GOAL_LISTENER_TIMEOUT_S = 2.0
"""To reach a program that listens to goals; connections are there after about 0.1 s."""

STOP_PERIOD_S = 0.06

Tell = Callable[[str, str], None]
"""Takes a level (info, warn, error) and a text for people, on any thread."""


class Commander:
    """What pages make robots do. Times are monotonic."""

    def __init__(self, drivers: Drivers) -> None:
        self._drivers = drivers
        self._dead_man = DeadMan()
        self._worker = ThreadPoolExecutor(1, "commands")
        self._velocities: Dict[str, Optional[rospy.Publisher]] = {}
        self._goals: Dict[str, rospy.Publisher] = {}
        self._waiting_goals = 0

    # ---------------------------------------------------------------- driving by hand

    def drive(self, page: int, velocity: Velocity) -> bool:
        """Drive a robot for a moment; return False if another page drives it."""
        if not self._dead_man.hold(page, velocity, time.monotonic()):
            return False
        self._publish(velocity)
        return True

    def release(self, page: int, namespace: str) -> None:
        """A page lets go of a robot."""
        self._dead_man.release(page, namespace)

    def drop_page(self, page: int) -> None:
        """A page is gone."""
        self._dead_man.drop_page(page)

    def step(self) -> None:
        """Stop what is to be stopped; to be called every 0.06 to 0.1 s."""
        for velocity in self._dead_man.take_stops(time.monotonic()):
            self._publish(velocity)

    def _publish(self, velocity: Velocity) -> None:
        publisher = self._velocities.get(velocity.namespace)
        if publisher is not None:
            message = Twist()
            message.linear.x, message.angular.z = velocity.linear_m_s, velocity.turn_rad_s
            publisher.publish(message)
        elif velocity.namespace not in self._velocities:
            self._velocities[velocity.namespace] = None
            self._worker.submit(self._open_velocity, velocity.namespace)

    def _open_velocity(self, namespace: str) -> None:
        self._velocities[namespace] = rospy.Publisher(
            namespace + "/velocity_controller/cmd_vel", Twist, queue_size=1, tcp_nodelay=True
        )

    # ---------------------------------------------------------------- goals

    def send_goal(self, namespace: str, goal: Pose, with_heading: bool, tell: Tell) -> None:
        """Give a goal in hero_N/odom to whoever listens for goals of this robot."""
        if self._waiting_goals >= GOALS_AT_ONCE:
            tell("error", "too many goals at once")
            return
        self._waiting_goals += 1
        self._worker.submit(self._send_goal, namespace, goal, with_heading, tell)

    def _send_goal(self, namespace: str, goal: Pose, with_heading: bool, tell: Tell) -> None:
        name, topic = namespace.strip("/"), namespace + "/goal"
        try:
            if not self._has_listener(topic):
                tell(
                    "error",
                    'nobody takes goals for %s: roslaunch hero_examples go_to_goal.launch robots:="%s"'
                    % (name, name.rpartition("_")[2]),
                )
                return
            message = PoseStamped()
            message.header.stamp = rospy.Time.now()
            message.header.frame_id = name + "/odom"
            message.pose.position.x, message.pose.position.y = goal.x_m, goal.y_m
            if with_heading:
                turn = message.pose.orientation
                turn.z, turn.w = math.sin(goal.yaw_rad / 2.0), math.cos(goal.yaw_rad / 2.0)
            self._goals[topic].publish(message)
            tell("info", "%s has a new goal" % name)
        except rosgraph.MasterException as error:
            tell("error", "the ROS master does not answer: %s" % error)
        finally:
            self._waiting_goals -= 1

    def _has_listener(self, topic: str) -> bool:
        """Return whether a node other than this one listens, once the way to it is open."""
        own_name = rospy.get_name()
        _, subscribed, _ = rosgraph.Master(own_name).getSystemState()
        others = [node for name, nodes in subscribed if name == topic for node in nodes if node != own_name]
        if not others:
            return False
        if topic not in self._goals:
            # Not latched: a program that starts later must not find an old goal.
            self._goals[topic] = rospy.Publisher(topic, PoseStamped, queue_size=2, tcp_nodelay=True)
        deadline_s = time.monotonic() + GOAL_LISTENER_TIMEOUT_S
        # The page shows goals, so this node listens as well, and counts.
        while self._goals[topic].get_num_connections() < len(others) + 1 and time.monotonic() < deadline_s:
            time.sleep(0.02)
        return True

    # ---------------------------------------------------------------- stop

    def request_stop(self, stop: bool) -> None:
        """Ask all drivers to stop all robots, or to release them."""
        self._drivers.request_stop(stop)
        if stop:
            self._dead_man.drop_all()
            self.step()

    def may_drive(self) -> bool:
        """Return whether pages may drive robots: not while they are being stopped, or released."""
        status = self._drivers.stop_status()
        return status is None or status.is_final

    def close(self) -> None:
        """Stop all that was driven by hand, more than once; takes about 0.2 s."""
        self._dead_man.drop_all()
        for _ in range(STOPS):
            self.step()
            time.sleep(STOP_PERIOD_S)
        self._worker.shutdown(wait=False)
