#!/usr/bin/env python3
"""The program fleet beside two simulated robots: as JSON, as lines, and in a terminal."""

import json
import os
import socket
import subprocess
import unittest

import rospy
import rostest
from geometry_msgs.msg import Twist

from hero_test.program_terminal import FLEET, ProgramTerminal, run_fleet
from hero_test.waiting import wait_for


class FleetTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        def both_are_ready():
            code, output, _ = run_fleet("--once", "--json")
            robots = json.loads(output)["robots"] if code == 0 else []
            return [robot["state"] for robot in robots] == ["READY", "READY"]

        wait_for(both_are_ready, "two robots that are ready")

    def test_json_holds_the_state_rates_and_pose_of_every_robot(self):
        code, output, errors = run_fleet("--once", "--json")
        self.assertEqual(code, 0, errors)
        fleet = json.loads(output)
        self.assertEqual(fleet["listening"], "127.0.0.1:21290")
        self.assertEqual([robot["id"] for robot in fleet["robots"]], [0, 1])
        for robot in fleet["robots"]:
            self.assertEqual(robot["state"], "READY")
            self.assertGreater(robot["odom_hz"], 15.0)
            self.assertGreater(robot["bytes_per_s"], 10e3)
            self.assertIsNotNone(robot["pose"])
            self.assertIn("nearest", robot)
            self.assertIn(":", robot["address"])

    def test_robots_that_stand_and_robots_that_are_not_there_are_named(self):
        code, _, errors = run_fleet("--seconds", "3", "--expect", "3")
        self.assertEqual(code, 1)
        self.assertIn("hero_0 joined but did not move", errors)
        self.assertIn("hero_2 did not join", errors)

    def test_robots_that_drive_are_not_named(self):
        publishers = [
            rospy.Publisher("/hero_%d/velocity_controller/cmd_vel" % number, Twist, queue_size=1)
            for number in range(2)
        ]
        command = Twist()
        command.angular.z = 2.0  # on the spot: there is nothing to run into
        process = subprocess.Popen(
            [*FLEET, "--seconds", "6", "--expect", "2"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )
        rate = rospy.Rate(10)
        while process.poll() is None:
            for publisher in publishers:
                publisher.publish(command)
            rate.sleep()
        output = process.communicate()[0].decode()
        for publisher in publishers:
            publisher.publish(Twist())
        self.assertEqual(process.returncode, 0, output)
        self.assertIn("all 2 robots joined and moved", output)

    def test_in_a_terminal_it_draws_in_place_and_gives_the_terminal_back(self):
        table = ProgramTerminal("hero_tools", "fleet")
        self.addCleanup(table.close)
        table.wait_for(b"2 of 2 robots ready")
        table.wait_for(b"hero_1")
        table.wait_for(b"\x1b[?1049h")
        table.press(b"o")
        table.wait_for(b"now by state")
        table.press(b"q")
        self.assertEqual(table.wait_for_end(), 0)
        table.wait_for(b"\x1b[?1049l")
        self.assertEqual(table.settings(), table.settings_before)

    def test_wrong_options_are_refused_in_one_line(self):
        for name, value in (
            ("--seconds", "-1"),
            ("--seconds", "inf"),
            ("--seconds", "nan"),
            ("--expect", "2000000"),
        ):
            code, _, errors = run_fleet(name, value)
            self.assertEqual(code, 2, name)
            self.assert_one_line(errors, name)
        for arguments in (["--expect", "many"], ["--color"]):
            code, _, errors = run_fleet(*arguments)
            self.assertEqual(code, 2, arguments)
            self.assertNotIn("Traceback", errors)
            self.assertIn(arguments[0], errors)

    def assert_one_line(self, text, part):
        self.assertIn(part, text)
        self.assertEqual(len(text.splitlines()), 1, text)

    def test_a_ros_master_that_hangs_is_told_in_one_line(self):
        with socket.create_server(("127.0.0.1", 0)) as silent:
            uri = "http://127.0.0.1:%d" % silent.getsockname()[1]
            code, _, errors = run_fleet("--once", env={**os.environ, "ROS_MASTER_URI": uri})
        self.assertEqual(code, 1)
        self.assert_one_line(errors, "no answer within 3 s")


if __name__ == "__main__":
    rospy.init_node("test_fleet")
    rostest.rosrun("hero_tools", "test_fleet", FleetTest)
