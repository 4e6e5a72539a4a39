#!/usr/bin/env python3
"""The program fleet beside two simulated robots: as JSON, as lines, and in a terminal."""

import json
import os
import socket
import unittest

import rospy
import rostest
from geometry_msgs.msg import Twist, Vector3

from hero_test.nonempty import nonempty
from hero_test.processes import Program, find_program
from hero_test.program_terminal import ProgramTerminal, run_fleet
from hero_test.waiting import wait_for
from hero_test.watches.fleet_report import wait_until_ready

INTERRUPTED = 130


class FleetTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        wait_until_ready(0, 1)

    def test_json_holds_address_and_state_of_every_robot(self):
        code, output, errors = run_fleet("--once", "--json")
        self.assertEqual(code, 0, errors)
        fleet = json.loads(output)
        self.assertEqual(fleet["listening"], "127.0.0.1:21290")
        self.assertEqual([robot["id"] for robot in fleet["robots"]], [0, 1])
        for robot in nonempty(fleet["robots"]):
            self.assertEqual(robot["state"], "READY")
            self.assertIn(":", robot["address"])

    def test_robots_that_stand_and_robots_that_are_not_there_are_named(self):
        program = self.start("--expect", "3", "--json")
        for robot in nonempty(self.wait_for_robots(program, "pose")):
            self.assertGreater(robot["odom_hz"], 0.0)
            self.assertGreater(robot["bytes_per_s"], 0.0)
            self.assertIn("nearest", robot)
        self.assertEqual(program.end(), INTERRUPTED)
        self.assertIn("hero_0 joined but did not move", program.text())
        self.assertIn("hero_2 did not join", program.text())

    def test_robots_that_drive_are_not_named(self):
        publishers = [
            rospy.Publisher("/hero_%d/velocity_controller/cmd_vel" % number, Twist, queue_size=1) for number in range(2)
        ]
        command = Twist(angular=Vector3(0.0, 0.0, 2.0))  # on the spot: there is nothing to run into

        def drive(event):
            for publisher in publishers:
                publisher.publish(command)

        program = self.start("--expect", "2", "--json")
        timer = rospy.Timer(rospy.Duration(0.1), drive)
        try:
            self.wait_for_robots(program, "moved")
        finally:
            timer.shutdown()
            timer.join()
            for publisher in publishers:
                publisher.publish(Twist())
        self.assertEqual(program.end(), INTERRUPTED)
        self.assertIn("all 2 robots joined and moved", program.text())

    def start(self, *arguments):
        program = Program(find_program("hero_tools", "fleet"), *arguments)
        self.addCleanup(program.close)
        return program

    def wait_for_robots(self, program, key):
        """Return both robots of the first line that fleet prints in which they have a true value of key."""

        def are_shown():
            lines = program.find_lines(r"^\{")
            robots = json.loads(lines[-1])["robots"] if lines else []
            return robots if len(robots) == 2 and all(robot[key] for robot in robots) else None

        return wait_for(are_shown, "%s of both robots" % key)

    def test_it_ends_by_itself_after_its_time(self):
        code, output, errors = run_fleet("--seconds", "0.5")
        self.assertEqual(code, 0, errors)
        # On a busy machine half a second is over before the driver is heard.
        self.assertRegex(output, "robots ready|no driver yet")

    def test_in_a_terminal_it_draws_in_place_and_gives_the_terminal_back(self):
        table = ProgramTerminal("hero_tools", "fleet")
        self.addCleanup(table.close)
        table.wait_for(b"2 of 2 robots ready")
        table.wait_for(b"hero_1")
        table.wait_for(b"\x1b[?1049h")
        table.press(b"q")
        self.assertEqual(table.wait_for_end(), 0)
        table.wait_for(b"\x1b[?1049l")
        self.assertEqual(table.settings(), table.settings_before)

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
