#!/usr/bin/env python3
"""Motions of Robot and Swarm over ROS: on threads, and while all robots are stopped.

How motions drive and fail is tested in virtual time: hero_sim/test/unit/test_sim_step_motions.py.
"""

import math
import sys
import unittest

import rospy
import rostest

from hero_client import GoalError, StoppedError, Swarm
from hero_test.robot_program import go_around
from hero_test.waiting import wait_for
from hero_test.watches.swarm_watch import SwarmWatch

ROBOTS = 6
CORNERED = 4
"""hero_4 stands in the corner: a wall 0.12 m ahead of its center, another 0.16 m to its left."""

DEADLINE_S = 60.0

STOPPED = r"hero_0 does not move: the driver hero_driver has stopped all robots\. Release .*hero_driver/stop false"


class RobotMotionsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.watch = SwarmWatch(range(ROBOTS))
        cls.watch.wait_until_complete(60.0)
        cls.swarm = Swarm(range(ROBOTS)).wait_until_ready(DEADLINE_S)

    def measure_way_m(self, robot_id, before):
        """Return how far a robot is from a pose of before, as far as this test has heard."""
        return math.dist(before[:2], self.watch.pose(robot_id)[:2])

    def start_driving(self, robot):
        motion = robot.start_go_to(5.0, 0.0, frame="robot")
        wait_for(lambda: self.watch.rows[robot.robot_id][-1][4] > 0.03, "motion")
        return motion

    def test_a_program_for_a_robot_runs_as_it_does_in_process(self):
        before = self.watch.pose(1)
        pose = go_around(self.swarm[1])
        self.assertLess(math.dist(pose[:2], (0.06, 0.0)), 0.02)
        wait_for(lambda: abs(self.measure_way_m(1, before) - 0.06) < 0.02, "hero_1 where its program left it")
        wait_for(lambda: self.watch.at_rest(1), "rest")

    def test_a_swarm_moves_at_once_and_tells_who_did_not(self):
        before = self.watch.pose(3)
        with self.assertRaisesRegex(GoalError, r"\Ahero_4 did not reach[^;]*in the way[^;]*\Z"):
            Swarm([3, CORNERED]).go_to(0.1, 0.0, frame="robot")
        wait_for(lambda: abs(self.measure_way_m(3, before) - 0.1) < 0.015, "hero_3 at its goal")

    def test_while_all_robots_are_stopped_motions_fail_and_commands_warn(self):
        robot = self.swarm[0]
        self.assertFalse(robot.is_stopped)
        motion = self.start_driving(robot)
        self.swarm.emergency_stop()
        try:
            wait_for(lambda: robot.is_stopped, "the stop")
            with self.assertRaisesRegex(StoppedError, STOPPED):
                motion.result(DEADLINE_S)
            with self.assertLogs("rosout", "WARNING") as log:
                robot.drive(0.1, 0.0)  # one command in a loop is no error
            self.assertRegex(log.output[0], STOPPED)
        finally:
            self.swarm.release_stop()
        wait_for(lambda: not robot.is_stopped, "the release")


if __name__ == "__main__":
    rospy.init_node("test_robot_motions")
    rostest.rosrun("hero_bringup", "robot_motions", RobotMotionsTest, sys.argv)
