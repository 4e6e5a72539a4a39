#!/usr/bin/env python
"""The program fleet beside two simulated robots: as JSON, as lines, and in a terminal."""

import fcntl
import json
import os
import pty
import struct
import subprocess
import termios
import unittest

import rospy
import rostest
from geometry_msgs.msg import Twist
from swarm_watch import wait_for

FLEET = ["rosrun", "hero_bringup", "fleet"]
TIMEOUT_S = 60.0


def run_fleet(*arguments):
    result = subprocess.run(
        [*FLEET, *arguments],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        timeout=TIMEOUT_S,
        check=False,
    )
    return result.returncode, result.stdout.decode(), result.stderr.decode()


class FleetTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        def both_are_ready():
            code, output, _ = run_fleet("--once", "--json")
            robots = json.loads(output)["robots"] if code == 0 else []
            return [robot["state"] for robot in robots] == ["READY", "READY"]

        wait_for(both_are_ready, TIMEOUT_S, "two robots that are ready")

    def test_json_holds_state_address_rates_pose_and_nearest_obstacle_of_every_robot(self):
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
        leader, follower = pty.openpty()
        fcntl.ioctl(follower, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 200, 0, 0))
        before = termios.tcgetattr(follower)
        process = subprocess.Popen(
            FLEET, stdin=follower, stdout=follower, stderr=follower, start_new_session=True
        )
        output = b""

        def read_until(text):
            nonlocal output
            output += os.read(leader, 65536)
            return text in output

        wait_for(lambda: read_until(b"2 of 2 robots ready"), TIMEOUT_S, "table")
        wait_for(lambda: read_until(b"hero_1"), TIMEOUT_S, "row")
        self.assertIn(b"\x1b[?1049h", output)
        os.write(leader, b"d")
        wait_for(lambda: read_until(b"choose a robot first"), TIMEOUT_S, "request to choose a robot")
        os.write(leader, b"\x1b[B\x1b[B")
        wait_for(lambda: read_until(b"\x1b[7mhero_1"), TIMEOUT_S, "robot that is chosen")
        os.write(leader, b"d")
        wait_for(lambda: read_until(b"d again disconnects hero_1"), TIMEOUT_S, "question")
        os.write(leader, b"d")
        wait_for(lambda: read_until(b"disconnected; it will dial again"), TIMEOUT_S, "answer of the driver")
        wait_for(lambda: read_until(b"reconnected 1x"), TIMEOUT_S, "robot that has come back")
        os.write(leader, b"o")
        wait_for(lambda: read_until(b"order: state"), TIMEOUT_S, "another order")
        os.write(leader, b"q")
        wait_for(lambda: read_until(b"\x1b[?1049l"), TIMEOUT_S, "end of the screen")
        self.assertEqual(process.wait(TIMEOUT_S), 0)
        after = termios.tcgetattr(follower)
        self.assertEqual(after, before)
        os.close(leader)
        os.close(follower)

    def test_wrong_options_are_refused_in_one_line(self):
        for arguments in (["--seconds", "-1"], ["--period", "0"], ["--expect", "many"], ["--colour"]):
            code, _, errors = run_fleet(*arguments)
            self.assertEqual(code, 2, arguments)
            self.assertNotIn("Traceback", errors)
            self.assertIn(arguments[0], errors)


if __name__ == "__main__":
    rospy.init_node("test_fleet")
    rostest.rosrun("hero_bringup", "test_fleet", FleetTest)
