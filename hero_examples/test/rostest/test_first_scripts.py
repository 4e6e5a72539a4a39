#!/usr/bin/env python
"""The five first scripts move simulated robots and leave them stopped, judged by the ground truth."""

import math
import signal
import sys
import unittest

import rospy
import rostest

from hero_client import Robot
from hero_test.example_program import ExampleProgram
from hero_test.swarm_watch import SwarmWatch
from hero_test.waiting import wait_for


class FirstScriptsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.watch = SwarmWatch([0, 1])
        cls.watch.wait_until_complete()
        for robot_id in (0, 1):
            Robot(robot_id).wait_until_ready(timeout_s=30.0)

    def start(self, name):
        program = ExampleProgram(name)
        self.addCleanup(program.close)
        return program

    def run_to_end(self, name):
        program = self.start(name)
        self.assertEqual(0, program.wait_end(), program.text())
        self.watch.wait_until_stopped(0, 1)
        return program.text()

    def test_move_drives_forward_and_turns_left(self):
        before = self.watch.pose(0)
        self.run_to_end("move")
        after = self.watch.pose(0)
        self.assertGreater(math.dist(before[:2], after[:2]), 0.1)
        self.assertGreater(math.remainder(after[2] - before[2], math.tau), 0.5)

    def test_read_sensors_turns_and_prints_what_is_seen(self):
        before = self.watch.pose(0)
        text = self.run_to_end("read_sensors")
        self.assertNotEqual(before[2], self.watch.pose(0)[2])
        for words in ("pose: x ", "ranges from the front", "nearest: "):
            self.assertEqual(20, text.count(words), text)

    def test_drive_a_square_returns_to_its_start(self):
        before, first = self.watch.pose(0), len(self.watch.rows[0])
        self.run_to_end("drive_a_square")
        self.assertLess(math.dist(before[:2], self.watch.pose(0)[:2]), 0.05)
        farthest_m = max(math.dist(before[:2], row[1:3]) for row in self.watch.rows[0][first:])
        self.assertAlmostEqual(0.2 * math.sqrt(2.0), farthest_m, delta=0.05)

    def test_avoid_drives_until_ctrl_c_and_stops(self):
        program = self.start("avoid")
        wait_for(lambda: self.watch.rows[0][-1][4] > 0.04, "motion")
        self.assertNotEqual(0, program.end(signal.SIGINT))
        self.watch.wait_until_stopped(0)

    def test_all_robots_turns_every_robot(self):
        before = [self.watch.pose(robot_id)[2] for robot_id in (0, 1)]
        self.run_to_end("all_robots")
        for robot_id, yaw_rad in enumerate(before):
            self.assertGreater(abs(math.remainder(self.watch.pose(robot_id)[2] - yaw_rad, math.tau)), 0.5)


if __name__ == "__main__":
    rospy.init_node("test_first_scripts")
    rostest.rosrun("hero_examples", "first_scripts", FirstScriptsTest, sys.argv)
