#!/usr/bin/env python3
"""Motions of Robot and Swarm: done, or an error that says why not, judged by the simulator's ground truth."""

import math
import os
import signal
import socket
import subprocess
import sys
import unittest
from unittest import mock

import rospy
import rostest

from hero_client import GoalError, Robot, StoppedError, Swarm, rate
from hero_client.errors import FrameError, NodeError, RobotNotReadyError
from hero_test.light_watch import LightWatch
from hero_test.swarm_watch import SwarmWatch
from hero_test.waiting import wait_for

ROBOTS = 6
CORNERED = 4
"""hero_4 stands in the corner: a wall 0.12 m ahead of its center, another 0.16 m to its left."""

DEADLINE_S = 30.0

DARK = (0.15, 0.15, 0.15)
"""A light that is off, as the simulator shows it."""

NO_MASTER = "http://localhost:1"

STOPPED = r"hero_0 does not move: the driver hero_driver has stopped all robots\. Release .*hero_driver/stop false"

ABSENT = r"nothing subscribes to /hero_9/velocity_controller/cmd_vel: connected are hero_0, .*hero_5"

SQUARE = """
import math
from hero_client import Robot

with Robot(0) as robot:
    robot.blink("green", period_s=0.5)
    for _ in range(4):
        robot.forward(0.1)
        robot.turn(math.pi / 2)
"""

KEEP_DISTANCE = """
import math
from hero_client import Robot, rate

with Robot(4) as robot:
    robot.wait_until_ready()
    for _ in rate(10):
        nearest = robot.nearest()
        if nearest is None:
            robot.drive(0.05, 0.0)
        else:
            speed_m_s = 0.8 * (nearest.range_m - 0.15) * math.cos(nearest.bearing_rad)
            robot.drive(speed_m_s, 1.5 * nearest.bearing_rad)
"""


def angle(first_rad, second_rad):
    """Return the difference of two angles, without its sign."""
    return abs(math.remainder(first_rad - second_rad, math.tau))


class RobotMotionsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.watch = SwarmWatch(range(ROBOTS))
        cls.watch.wait_until_complete(60.0)
        cls.lights = LightWatch()
        cls.swarm = Swarm(range(ROBOTS)).wait_until_ready(DEADLINE_S)

    def run_script(self, code):
        """Run a script to its end; return its exit status and what it wrote to stderr."""
        ended = subprocess.run(
            [sys.executable, "-c", code], stderr=subprocess.PIPE, text=True, check=False, timeout=60
        )
        return ended.returncode, ended.stderr

    def start_script(self, code, **environment):
        script = subprocess.Popen(
            [sys.executable, "-c", code], stderr=subprocess.PIPE, text=True, env={**os.environ, **environment}
        )
        self.addCleanup(script.wait)
        self.addCleanup(script.kill)
        return script

    def test_forward_and_turn_move_by_what_they_are_told(self):
        robot, before = self.swarm[1], self.watch.pose(1)
        robot.forward(-0.1)
        robot.turn(1.0)
        self.watch.wait_until_stopped(1)
        after = self.watch.pose(1)
        self.assertAlmostEqual(-0.1, after[0] - before[0], delta=0.015)
        self.assertAlmostEqual(0.0, after[1] - before[1], delta=0.015)
        self.assertLess(angle(after[2] - before[2], 1.0), 0.1)

    def test_a_goal_behind_a_wall_is_an_error_that_tells_of_the_wall(self):
        robot = self.swarm[CORNERED]
        with self.assertRaisesRegex(GoalError, r"hero_4 did not reach \(0.3, 0\) .*obstacle is in the way, 0.\d\d m"):
            robot.go_to(0.3, 0.0, frame="robot")
        self.watch.wait_until_stopped(CORNERED)
        self.assertLess(self.watch.pose(CORNERED)[0], 2.0 - 0.04)  # it did not touch the wall
        robot.forward(-0.05)

    def test_a_goal_may_be_relative_to_the_robot_or_in_a_frame_of_tf(self):
        robot, before = self.swarm[2], self.watch.pose(2)
        robot.go_to(-0.1, 0.0, frame="robot")
        self.assertAlmostEqual(0.1, math.dist(before[:2], self.watch.pose(2)[:2]), delta=0.015)
        robot.go_to(*before[:2], frame="world")
        self.assertLess(math.dist(before[:2], self.watch.pose(2)[:2]), 0.02)
        self.assertLess(math.dist(robot.pose_in("world")[:2], self.watch.pose(2)[:2]), 0.02)
        with self.assertRaisesRegex(FrameError, "no transform from hero_2/odom to nowhere"):
            robot.pose_in("nowhere", timeout_s=0.1)

    def test_a_started_motion_ends_by_cancel_and_by_stop(self):
        robot = self.swarm[0]
        for end in (lambda motion: motion.cancel(), lambda motion: robot.stop()):
            motion = robot.start_go_to(5.0, 0.0, frame="robot")
            wait_for(lambda: self.watch.rows[0][-1][4] > 0.03, "motion")
            end(motion)
            with self.assertRaisesRegex(GoalError, "cancelled"):
                motion.result(DEADLINE_S)
            self.watch.wait_until_stopped(0)
        motion = robot.start_go_to(5.0, 0.0, frame="robot")
        robot.forward(-0.05)
        self.assertTrue(motion.done())

    def test_a_swarm_moves_as_one_and_tells_who_did_not(self):
        pair = Swarm([3, CORNERED])
        with self.assertRaisesRegex(GoalError, r"\Ahero_4 did not reach[^;]*in the way[^;]*\Z"):
            before = self.watch.pose(3)
            pair.go_to(0.15, 0.0, frame="robot")
        self.assertAlmostEqual(0.15, math.dist(before[:2], self.watch.pose(3)[:2]), delta=0.015)
        pair.drive(-0.1, 0.0, duration_s=0.8)
        self.watch.wait_until_stopped(3, CORNERED)
        self.assertLess(math.dist(before[:2], self.watch.pose(3)[:2]), 0.14)

    def test_while_all_robots_are_stopped_motions_are_errors_that_tell_so(self):
        robot = self.swarm[0]
        self.assertFalse(robot.is_stopped)
        motion = robot.start_go_to(5.0, 0.0, frame="robot")
        wait_for(lambda: self.watch.rows[0][-1][4] > 0.03, "motion")
        self.assertEqual("info", self.swarm.emergency_stop().level)
        try:
            self.assertTrue(robot.is_stopped)
            with self.assertRaisesRegex(StoppedError, STOPPED):
                motion.result(DEADLINE_S)
            for command in (lambda: robot.drive(0.1, 0.0, 1.0), lambda: robot.turn(1.0), lambda: robot.go_to(0.0, 0.0)):
                with self.assertRaisesRegex(StoppedError, STOPPED):
                    command()
            # One command in a loop is no error, but it is logged.
            with self.assertLogs("rosout", "ERROR") as log:
                robot.drive(0.1, 0.0)
            self.assertRegex(log.output[0], STOPPED)
            # A program that has just started knows it, too.
            script = "import hero_client, sys; sys.exit(hero_client.Robot(0).is_stopped)"
            self.assertEqual((1, ""), self.run_script(script))
        finally:
            self.swarm.release_stop()
        self.assertFalse(robot.is_stopped)

    def test_commands_to_a_robot_that_is_absent_are_warned_about_once(self):
        absent = Robot(9)
        with self.assertLogs("rosout", "WARNING") as log:
            for _ in range(3):
                absent.drive(0.1, 0.0)
            absent.stop()
        self.assertEqual(1, len(log.output), log.output)
        self.assertRegex(log.output[0], "a command is lost: " + ABSENT)
        with self.assertRaisesRegex(RobotNotReadyError, "hero_9 is not ready after 2 s: " + ABSENT):
            absent.forward(0.1)
        self.assertRegex(repr(absent), "<hero_9: " + ABSENT)

    def test_the_first_command_of_a_script_is_not_lost(self):
        before = self.watch.pose(5)[2]
        status, errors = self.run_script(
            "from hero_client import Robot, rate\n"
            "with Robot(5) as robot:\n"
            "    robot.drive(0.0, 1.5)\n"
            "    next(t for t in rate(50) if t > 0.6)\n"
        )
        self.assertEqual((0, ""), (status, errors))
        self.watch.wait_until_stopped(5)
        self.assertGreater(angle(self.watch.pose(5)[2], before), 0.2)

    def test_data_are_read_as_the_robot_has_them(self):
        robot = self.swarm[CORNERED]
        self.assertEqual(8, len(robot.wait_for_scan()))
        ticks = robot.encoder.left_ticks
        robot.set_pose(1.0, -2.0, 0.5)
        self.assertLess(math.dist((1.0, -2.0, 0.5), robot.pose), 0.01)
        self.assertRegex(repr(robot), r"<hero_4: ready, Pose\(x_m=1.000, y_m=-2.000, yaw_rad=0.500\)>")
        self.assertRegex(repr(self.swarm), "<Swarm of hero_0, .*: 6 of 6 ready>")
        self.assertNotEqual(ticks, robot.encoder.left_ticks)  # set_odom zeroes them

    def test_a_light_blinks_until_another_color_is_asked_for(self):
        robot = self.swarm[5]
        robot.blink("red", period_s=0.2)
        for _ in range(2):
            wait_for(lambda: self.lights.is_lit(5, (1.0, 0.0, 0.0)), "light")
            wait_for(lambda: self.lights.is_lit(5, DARK), "darkness")
        robot.led("blue")
        wait_for(lambda: self.lights.is_lit(5, (0.0, 0.0, 1.0)), "blue")
        with self.assertRaisesRegex(ValueError, "at least 0.2 s"):
            robot.blink("red", period_s=0.0)

    def test_without_a_master_constructors_fail_with_one_line(self):
        for code in ("Robot(0)", "Swarm([0, 1])", "Swarm.discover()"):
            script = self.start_script("from hero_client import *; " + code, ROS_MASTER_URI=NO_MASTER)
            errors = script.communicate(timeout=DEADLINE_S)[1]
            self.assertEqual(1, script.returncode, errors)
            self.assertRegex(errors, r"\A-c: no ROS master at [^\n]*: start roslaunch [^\n]*\n\Z")
        # So does a node that runs already, which rospy would let wait for ever.
        with mock.patch.dict(os.environ, ROS_MASTER_URI=NO_MASTER), self.assertRaisesRegex(NodeError, "no ROS master"):
            Robot(7)

    def test_ctrl_c_ends_a_script_that_waits_for_a_silent_master(self):
        with socket.create_server(("localhost", 0)) as silent:
            uri = "http://localhost:%d" % silent.getsockname()[1]
            script = self.start_script("from hero_client import *; Robot(0)", ROS_MASTER_URI=uri)
            silent.settimeout(DEADLINE_S)
            connection, _ = silent.accept()
            self.addCleanup(connection.close)
            script.send_signal(signal.SIGINT)
            self.assertEqual("", script.communicate(timeout=DEADLINE_S)[1])
            self.assertEqual(-signal.SIGINT, script.returncode)

    def test_rate_yields_the_time_at_its_rate(self):
        times_s = [time_s for _, time_s in zip(range(4), rate(50))]
        self.assertGreaterEqual(times_s[-1], 0.059)
        with self.assertRaisesRegex(ValueError, "more than 0 Hz"):
            next(rate(0))

    def test_the_square_of_ten_lines_returns_to_its_start_blinking(self):
        self.assertLessEqual(len(SQUARE.split("\n")) - 2, 12)
        before = self.watch.pose(0)
        status, errors = self.run_script(SQUARE)
        self.assertEqual((0, ""), (status, errors))
        self.watch.wait_until_stopped(0)
        self.assertLess(math.dist(before[:2], self.watch.pose(0)[:2]), 0.03)
        self.assertLess(angle(before[2], self.watch.pose(0)[2]), 0.2)

    def test_the_program_of_fifteen_lines_keeps_its_distance_until_ctrl_c(self):
        self.assertLessEqual(len(KEEP_DISTANCE.split("\n")) - 2, 20)
        script = self.start_script(KEEP_DISTANCE)

        def keeps_distance():
            nearest = self.swarm[CORNERED].nearest()
            is_near = nearest is not None and abs(nearest.range_m - 0.15) < 0.01
            return is_near and abs(self.watch.rows[CORNERED][-1][4]) < 0.005

        wait_for(keeps_distance, "0.15 m from the wall")
        script.send_signal(signal.SIGINT)
        self.assertEqual("", script.communicate(timeout=DEADLINE_S)[1])
        self.watch.wait_until_stopped(CORNERED)


if __name__ == "__main__":
    rospy.init_node("test_robot_motions")
    rostest.rosrun("hero_bringup", "robot_motions", RobotMotionsTest, sys.argv)
