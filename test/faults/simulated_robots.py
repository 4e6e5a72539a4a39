"""Simulated robots for the fault suite: their ground truth, and programs that drive them.

They are drawn from the spread of real robots: servo centers, the servo timing of their core, whether their flash knows
the centers. Every run draws the same ones; the environment variable HERO_SEED draws others.
"""

import math
import os
import random

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rig import Program

from hero_test.processes import find_program
from hero_test.waiting import wait_for

SPEED_M_S = 0.1
REST_M_S = 0.003
SEED = int(os.environ.get("HERO_SEED", "0"))
CENTERS_US = (1450, 1550)
DEAD_ZONE_US = 15


class GroundTruth:
    """Where the simulator has one robot, and a program that drives it at 10 Hz."""

    def __init__(self, number, controller="velocity_controller"):
        self.name = "hero_%d" % number
        self.path = []
        self._subscriber = rospy.Subscriber(f"/{self.name}/ground_truth", Odometry, self._receive, tcp_nodelay=True)
        self.publisher = rospy.Publisher(f"/{self.name}/{controller}/cmd_vel", Twist, queue_size=1, tcp_nodelay=True)
        self.command = Twist()
        self._timer = rospy.Timer(rospy.Duration(0.1), lambda _: self.publisher.publish(self.command))

    def _receive(self, message):
        position, twist = message.pose.pose.position, message.twist.twist
        self.path.append((position.x, position.y, math.hypot(twist.linear.x, 0.03 * twist.angular.z)))

    def close(self):
        """Command nothing any more."""
        self._timer.shutdown()
        self._subscriber.unregister()
        self.publisher.unregister()

    @property
    def is_moving(self):
        """Whether it drives at about the speed of drive()."""
        return bool(self.path) and self.path[-1][2] > 0.7 * SPEED_M_S

    @property
    def is_stopped(self):
        """Whether it stood in the last five readings."""
        return len(self.path) > 5 and all(entry[2] < REST_M_S for entry in self.path[-5:])

    def measure_from(self, index):
        """Return how far it went since path[index]."""
        x_m, y_m, _ = self.path[index]
        return math.hypot(self.path[-1][0] - x_m, self.path[-1][1] - y_m)


def start_simulator(robots, port, *arguments, first_id=0):
    """Return a simulator whose robots, drawn with SEED, dial a port of this machine; it ends with `with`."""
    command = [find_program("hero_sim", "hero_sim"), "--count", robots, "--first-id", first_id, "--port", port]
    command += ["--arena", "empty", "--quiet", *_draw_robots(robots, first_id), *arguments]
    return Program(*map(str, command))


def _draw_robots(robots, first_id):
    rng = random.Random(SEED)
    options = ["--seed", SEED, "--servo-timing", "drawn", "--motors", rng.choice(("calibrated", "factory"))]
    for number in range(first_id, first_id + robots):
        known = (number, rng.randint(*CENTERS_US), rng.randint(*CENTERS_US), DEAD_ZONE_US)
        options += ["--error", "robot=%d,left_center_us=%d,right_center_us=%d,dead_zone_us=%d" % known]
    return options


def drive(ground_truths):
    """Let all robots drive in circles; return when they do."""
    for ground_truth in ground_truths:
        ground_truth.command.linear.x, ground_truth.command.angular.z = SPEED_M_S, 0.5
    wait_for(lambda: all(ground_truth.is_moving for ground_truth in ground_truths), "all robots to move")


def wait_until_stopped(ground_truths):
    """Return when all robots stand, whatever they are told."""
    wait_for(lambda: all(ground_truth.is_stopped for ground_truth in ground_truths), "all robots to stand")
