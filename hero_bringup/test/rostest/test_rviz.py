#!/usr/bin/env python3
"""rviz:=true on a screen that nobody looks at: robots are drawn where the simulator says that they are."""

import os
import signal
import subprocess
import unittest
from pathlib import Path

import numpy as np
import rospy
import rostest
from geometry_msgs.msg import Twist
from std_msgs.msg import ColorRGBA

from hero_test.screens.virtual_screen import MISSING, VirtualScreen
from hero_test.waiting import wait_for
from hero_test.watches.swarm_watch import SwarmWatch

TIMEOUT_S = 60.0
NEAR_M = 0.015
LIGHTS = {0: (1.0, 0.0, 0.0), 1: (0.0, 1.0, 0.0), 2: (0.0, 0.0, 1.0)}
BRIGHT, DIM = 110, 60
BLOB_PIXELS_MIN = 8
PIXELS_PER_M = 300  # displays.yaml
SIDE_M = 1.6  # of the walls in square_arena.yaml
WALL_SHARE = 0.8  # the side panels are 0.7 as wide as a wall is long
WALL_PIXELS = 4


def find_blob(picture, color):
    """Return the middle (right, down) of what has a light's color, None if there is too little of it."""
    matches = np.ones(picture.shape[:2], dtype=bool)
    for channel, share in enumerate(color):
        matches &= picture[:, :, channel] > BRIGHT if share else picture[:, :, channel] < DIM
    down, right = np.nonzero(matches)
    return (float(np.median(right)), float(np.median(down))) if len(right) >= BLOB_PIXELS_MIN else None


def find_walls(picture, side_m):
    """Return the middle (right, down) of a square of gray walls, None if it is not there."""
    gray = (np.ptp(picture.astype(int), axis=2) < 12) & (picture.mean(axis=2) < 190) & (picture.mean(axis=2) > 60)
    length = side_m * PIXELS_PER_M
    middle = []
    for axis in (0, 1):
        lines = np.flatnonzero(gray.sum(axis=axis) > WALL_SHARE * length)
        # Edges of panels are gray lines, too; walls are two lines that are as far apart as they should be.
        pairs = [(one + other) / 2.0 for one in lines for other in lines if abs(other - one - length) <= WALL_PIXELS]
        if not pairs:
            return None
        middle.append(float(np.mean(pairs)))
    return middle[0], middle[1]


@unittest.skipIf(MISSING, "not installed: %s (script/bootstrap --test)" % ", ".join(MISSING))
class RvizTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.screen = VirtualScreen(1400, 1000)
        cls.start_rviz()
        if cls.launch.poll() is not None:
            cls.start_rviz()
        cls.watch = SwarmWatch(LIGHTS)
        cls.watch.wait_until_complete(TIMEOUT_S)
        cls.lights = {
            robot_id: rospy.Publisher("/hero_%d/led" % robot_id, ColorRGBA, queue_size=1) for robot_id in LIGHTS
        }

    @classmethod
    def start_rviz(cls):
        """Start all, and wait until RViz shows the arena, or has died.

        RViz 1.14.19 has damaged its own memory in one of 75 starts, before it opened a window.
        """
        arena = Path(__file__).with_name("square_arena.yaml")
        cls.launch = subprocess.Popen(
            ["roslaunch", "hero_bringup", "hero_bringup.launch", "host:=127.0.0.1", "port:=21342", "count:=3"]
            + ["arena:=%s" % arena, "rviz:=true", "rviz_view:=above"],
            env=cls.screen.environment(),
            start_new_session=True,
        )
        wait_for(lambda: cls.launch.poll() is not None or find_walls(cls.screen.read(), SIDE_M), "a picture of RViz")

    @classmethod
    def tearDownClass(cls):
        cls.watch.close()
        os.killpg(cls.launch.pid, signal.SIGINT)
        cls.launch.wait(TIMEOUT_S)
        cls.screen.close()

    def show_lights(self):
        for robot_id, color in LIGHTS.items():
            self.lights[robot_id].publish(ColorRGBA(*color, 1.0))

    def measure_errors(self):
        """Return how far (m) each robot is drawn from where it is; None while not all is on the screen."""
        self.show_lights()
        self.picture = self.screen.read()
        middle = find_walls(self.picture, side_m=SIDE_M)
        if middle is None:
            return None
        reach = int(SIDE_M / 2 * PIXELS_PER_M)
        left, top = int(middle[0]) - reach, int(middle[1]) - reach
        inside = self.picture[top : top + 2 * reach, left : left + 2 * reach]
        errors = {}
        for robot_id, color in LIGHTS.items():
            blob = find_blob(inside, color)
            if blob is None:
                return None
            x_m = (left + blob[0] - middle[0]) / PIXELS_PER_M
            y_m = (middle[1] - top - blob[1]) / PIXELS_PER_M
            errors[robot_id] = float(np.hypot(*(np.array([x_m, y_m]) - self.watch.pose(robot_id)[:2])))
        return errors

    def wait_until_drawn_in_place(self, name):
        def are_in_place():
            self.errors = self.measure_errors()
            return self.errors is not None and max(self.errors.values()) < NEAR_M

        try:
            wait_for(are_in_place, "robots to be drawn where they are")
        except AssertionError as error:
            raise AssertionError("%s; off by (m): %s" % (error, self.errors)) from None
        finally:
            import matplotlib.image

            folder = Path(os.environ.get("ROS_TEST_RESULTS_DIR", "."))
            matplotlib.image.imsave(str(folder / name), self.picture)

    def test_robots_are_drawn_where_they_are_before_and_after_they_drive(self):
        self.wait_until_drawn_in_place("rviz_start.png")
        start = self.watch.pose(0)[:2]
        drive = rospy.Publisher("/hero_0/velocity_controller/cmd_vel", Twist, queue_size=1)
        command = Twist()
        command.linear.x = 0.1

        def has_driven():
            drive.publish(command)
            return np.hypot(*np.subtract(self.watch.pose(0)[:2], start)) > 0.2

        wait_for(has_driven, "robot 0 to drive")
        drive.publish(Twist())
        self.wait_until_drawn_in_place("rviz_driven.png")


if __name__ == "__main__":
    rospy.init_node("test_rviz")
    rostest.rosrun("hero_bringup", "test_rviz", RvizTest)
