#!/usr/bin/env python3
"""The first scripts as programs, all at once, each with a robot of its own: they move it and leave it stopped.

What they do is tested in virtual time: see test/unit.
"""

import math
import signal
import sys
import unittest

import rospy
import rostest
from nav_msgs.msg import Odometry

from hero_test.processes import ExampleProgram
from hero_test.waiting import TIMEOUT_S, wait_for
from hero_test.watches.command_watch import CommandWatch
from hero_test.watches.swarm_watch import SwarmWatch

ROBOTS = range(10)
SCRIPTS = ["move", "read_sensors", "drive_a_square", "avoid"]
"""Of robot 0; here each drives the robot of its place in this list."""

TOPICS = ["odom", "proximity", "led", "velocity_controller/cmd_vel"]


class FirstScriptsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.watch, cls.commands = SwarmWatch(ROBOTS), CommandWatch(ROBOTS)
        cls.watch.wait_until_complete()
        for robot_id in ROBOTS:  # scripts wait 2 s for their robots, which all join the driver meanwhile
            rospy.wait_for_message("/hero_%d/odom" % robot_id, Odometry, TIMEOUT_S)
        cls.starts = {robot_id: cls.watch.pose(robot_id) for robot_id in ROBOTS}
        cls.programs = {}
        for robot_id, name in enumerate(SCRIPTS):
            remappings = ["/hero_0/%s:=/hero_%d/%s" % (topic, robot_id, topic) for topic in TOPICS]
            cls.programs[name] = ExampleProgram(name, *remappings)
            cls.addClassCleanup(cls.programs[name].close)

    def wait_until_moved(self, robot_id):
        x_m, y_m, yaw_rad = self.starts[robot_id]

        def has_moved():
            pose = self.watch.pose(robot_id)
            turned_rad = abs(math.remainder(pose[2] - yaw_rad, math.tau))
            return math.dist(pose[:2], (x_m, y_m)) > 0.03 or turned_rad > 0.3

        program = self.programs[SCRIPTS[robot_id]]
        wait_for(has_moved, lambda: "motion of hero_%d: %s" % (robot_id, program.text()))

    def wait_until_stopped(self, *robot_ids):
        """Wait until the scripts have stopped their robots, themselves, and these are at rest."""
        self.commands.wait_for_stops(*robot_ids)
        self.watch.wait_until_stopped(*robot_ids)

    def check_interrupted(self, name):
        """A script moves its robot until Ctrl-C, and stops it then."""
        robot_id = SCRIPTS.index(name)
        self.wait_until_moved(robot_id)
        self.assertNotEqual(0, self.programs[name].end(signal.SIGINT))
        self.assertNotIn("Traceback", self.programs[name].text())
        self.wait_until_stopped(robot_id)

    def check_ended(self, name):
        """A script moves its robot, ends by itself, and has stopped it then."""
        robot_id = SCRIPTS.index(name)
        self.wait_until_moved(robot_id)
        self.assertEqual(0, self.programs[name].wait_end(), self.programs[name].text())
        self.wait_until_stopped(robot_id)

    def test_1_move_drives_and_ends_by_itself(self):
        self.check_ended("move")

    def test_1_read_sensors_prints_what_is_seen_and_ends_by_itself(self):
        for text in ("pose: x ", "ranges from the front", "nearest: "):
            self.programs["read_sensors"].wait_for_text(text)
        self.check_ended("read_sensors")

    def test_0_drive_a_square_drives_until_it_is_interrupted(self):
        self.check_interrupted("drive_a_square")  # first: after four sides it would end by itself

    def test_1_avoid_drives_until_it_is_interrupted(self):
        self.check_interrupted("avoid")

    def test_2_all_robots_turns_every_robot_and_ends_by_itself(self):
        before = {robot_id: self.watch.pose(robot_id)[2] for robot_id in ROBOTS}
        program = ExampleProgram("all_robots")
        self.addCleanup(program.close)
        self.assertEqual(0, program.wait_end(), program.text())

        def have_all_turned():
            turned_rad = [math.remainder(self.watch.pose(i)[2] - yaw_rad, math.tau) for i, yaw_rad in before.items()]
            return min(map(abs, turned_rad)) > 0.3

        wait_for(have_all_turned, "every robot to have turned")
        self.wait_until_stopped(*ROBOTS)


if __name__ == "__main__":
    rospy.init_node("test_first_scripts")
    rostest.rosrun("hero_examples", "first_scripts", FirstScriptsTest, sys.argv)
