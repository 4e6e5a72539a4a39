#!/usr/bin/env python
"""The launch file as users start and end it: without robots, with a port in use, and again while robots wait."""

import signal
import socket
import subprocess
import sys
import threading
import unittest

import rospy
import rostest
from nav_msgs.msg import Odometry

from hero_msgs.msg import Robot, RobotArray
from hero_test.swarm_watch import wait_for

DEADLINE_S = 40.0


def find_free_port():
    """Return a port that nobody uses now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Program:
    """A program that a user started, and what it prints."""

    def __init__(self, *command):
        self.process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            universal_newlines=True,
            start_new_session=True,
        )
        self.lines = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def find(self, text):
        """Return the lines that hold text."""
        return [line for line in list(self.lines) if text in line]

    def wait_end(self):
        """Return the exit code."""
        code = self.process.wait(DEADLINE_S)
        self._reader.join()
        return code

    def end(self):
        """Press Ctrl-C, unless it has ended; return the exit code."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        return self.wait_end()

    def _read(self):
        for line in self.process.stdout:
            self.lines.append(line.rstrip("\n"))
        self.process.stdout.close()


class DriverRestartTest(unittest.TestCase):
    def setUp(self):
        self.fleet = None
        subscriber = rospy.Subscriber("/hero_driver/robots", RobotArray, self.receive)
        self.addCleanup(subscriber.unregister)
        self.port = find_free_port()

    def receive(self, message):
        self.fleet = message

    def launch(self, *arguments):
        program = Program(
            "roslaunch",
            "hero_bringup",
            "hero_bringup.launch",
            "host:=127.0.0.1",
            "port:=%d" % self.port,
            *arguments,
        )
        self.addCleanup(program.end)
        return program

    def wait_ready(self, numbers):
        wait_for(
            lambda: (
                self.fleet
                and {robot.id for robot in self.fleet.robots if robot.state == Robot.READY} == set(numbers)
            ),
            DEADLINE_S, lambda: "robots %s, last: %s" % (numbers, self.fleet),
        )

    def test_without_robots_it_starts_and_says_where_it_listens(self):
        program = self.launch()
        wait_for(lambda: program.find("listening on 127.0.0.1:%d" % self.port), DEADLINE_S, lambda: program.lines)
        self.wait_ready([])
        self.assertEqual(program.end(), 0)
        self.assertEqual(program.find("Traceback"), [])

    def test_a_port_in_use_ends_it_with_one_clear_line(self):
        with socket.socket() as taken:
            taken.bind(("127.0.0.1", self.port))
            taken.listen(1)
            program = self.launch("count:=1")
            program.wait_end()
        self.assertEqual(len(program.find("~port %d is in use" % self.port)), 1, program.lines)
        self.assertEqual(program.find("Traceback"), [])

    def test_simulated_robots_come_with_it(self):
        self.launch("count:=2")
        self.wait_ready([0, 1])

    def test_robots_are_back_when_the_driver_is_started_again(self):
        odoms = []
        subscriber = rospy.Subscriber("/hero_4/odom", Odometry, odoms.append)
        self.addCleanup(subscriber.unregister)
        robots = Program(
            sys.executable, "-m", "hero_sim", "--count", "2", "--first-id", "4", "--port", str(self.port)
        )
        self.addCleanup(robots.end)
        for _ in range(2):
            program = self.launch()
            self.wait_ready([4, 5])
            seen = len(odoms)
            wait_for(lambda s=seen: len(odoms) > s + 20, DEADLINE_S, "odometry")
            self.assertEqual(program.end(), 0)
            self.fleet = None
        stamps = [message.header.stamp for message in odoms]
        self.assertEqual(stamps, sorted(stamps))


if __name__ == "__main__":
    rospy.init_node("test_driver_restart")
    rostest.rosrun("hero_bringup", "driver_restart", DriverRestartTest)
