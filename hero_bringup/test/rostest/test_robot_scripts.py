#!/usr/bin/env python3
"""Plain scripts with Robot and Swarm: their first command, their end by signals, and a ROS master that is missing."""

import os
import signal
import socket
import subprocess
import sys
import unittest
import xmlrpc.client
from unittest import mock

import rosgraph
import rospy
import rostest
from geometry_msgs.msg import Twist

from hero_client import Drivers, NodeError, Robot
from hero_test.nonempty import nonempty
from hero_test.waiting import wait_for
from hero_test.watches.fleet_report import wait_until_ready
from hero_test.watches.swarm_watch import SwarmWatch

IDS = range(40, 44)
LAST = IDS[-1]
COMMANDS = "/hero_%d/velocity_controller/cmd_vel"

DEADLINE_S = 60.0

NO_MASTER = "http://localhost:1"

DRIVE_FOR_EVER = """
from hero_client import Robot
with Robot(%d) as robot:
    robot.drive(0.05, 0.0, duration_s=600)
"""

TURN_AND_END = """
from hero_client import Robot, rate
with Robot(%d) as robot:
    robot.drive(0.0, 1.5)
    next(time_s for time_s in rate(50) if time_s > 0.6)
"""


class CommandLog:
    """The speeds that are commanded to one robot from now on."""

    def __init__(self, robot_id):
        self.speeds_m_s = []
        topic = COMMANDS % robot_id
        rospy.Subscriber(topic, Twist, lambda twist: self.speeds_m_s.append(twist.linear.x), queue_size=100)


def connect_and_leave(topic):
    """Do to all that publish a topic what rospy does where it is told of a publisher twice at once."""
    master = rosgraph.Master("/test")
    for node in dict(master.getSystemState()[0])[topic]:
        with xmlrpc.client.ServerProxy(master.lookupNode(node)) as publisher:
            _, _, (_, host, port) = publisher.requestTopic("/test", topic, [["TCPROS"]])
        socket.create_connection((host, port)).close()


class RobotScriptsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.watch = SwarmWatch(IDS)
        cls.watch.wait_until_complete(60.0)
        wait_until_ready(*IDS)

    def start(self, code, **environment):
        script = subprocess.Popen(
            [sys.executable, "-c", code], stderr=subprocess.PIPE, text=True, env={**os.environ, **environment}
        )
        self.addCleanup(script.wait)
        self.addCleanup(script.kill)
        return script

    def end(self, script):
        """Wait for the end of a script; return its exit status and what it wrote to stderr."""
        errors = script.communicate(timeout=DEADLINE_S)[1]
        return script.returncode, errors

    def test_scripts_that_are_ended_by_signals_leave_their_robots_stopped(self):
        ends = ((signal.SIGINT, -signal.SIGINT), (signal.SIGTERM, 143), (signal.SIGHUP, 129))
        scripts = [self.start(DRIVE_FOR_EVER % robot_id) for robot_id in IDS[: len(ends)]]
        rows = self.watch.rows.values()
        wait_for(lambda: sum(row[-1][4] > 0.03 for row in rows) == len(ends), "motion of all")
        for robot_id in IDS[: len(ends)]:
            connect_and_leave(COMMANDS % robot_id)
        logs = [CommandLog(robot_id) for robot_id in IDS[: len(ends)]]
        wait_for(lambda: all(log.speeds_m_s for log in nonempty(logs)), "commands")
        for script, (number, status) in nonempty(zip(scripts, ends)):
            script.send_signal(number)
            self.assertEqual((status, ""), self.end(script))
        wait_for(lambda: all(log.speeds_m_s[-1:] == [0.0] for log in nonempty(logs)), "a stop as the last command")
        wait_for(lambda: self.watch.at_rest(*IDS[: len(ends)]), "rest")

    def test_the_first_command_of_a_script_is_not_lost(self):
        before_rad = self.watch.pose(LAST)[2]
        self.assertEqual((0, ""), self.end(self.start(TURN_AND_END % LAST)))
        wait_for(lambda: self.watch.pose(LAST)[2] - before_rad > 0.2, "the turn")
        wait_for(lambda: self.watch.at_rest(LAST), "rest")

    def test_a_script_that_has_just_started_knows_that_robots_are_stopped(self):
        drivers = Drivers()
        self.addCleanup(drivers.request_stop, False)
        code = "import hero_client, sys; sys.exit(hero_client.Robot(%d).wait_until_ready().is_stopped)" % LAST
        self.assertEqual((0, ""), self.end(self.start(code)))
        for is_stopped in (True, False):
            drivers.request_stop(is_stopped)
            wait_for(lambda: drivers.stop_status().level == "info", drivers.stop_status)
            self.assertEqual((int(is_stopped), ""), self.end(self.start(code)))

    def test_a_script_without_its_robot_ends_with_one_line(self):
        status, errors = self.end(self.start("from hero_client import *; Robot(77).wait_until_ready(timeout_s=0.2)"))
        self.assertEqual(1, status)
        self.assertRegex(errors, r"\A-c: hero_77 is not ready after 0.2 s: [^\n]*\n\Z")

    def test_without_a_master_constructors_fail_with_one_line(self):
        calls = ("Robot(0)", "Swarm([0, 1])", "Swarm.discover()")
        for script in [self.start("from hero_client import *; " + call, ROS_MASTER_URI=NO_MASTER) for call in calls]:
            status, errors = self.end(script)
            self.assertEqual(1, status)
            self.assertRegex(errors, r"\A-c: no ROS master at [^\n]*: start roslaunch [^\n]*\n\Z")
        # So does a node that runs already, which rospy would let wait for ever.
        with mock.patch.dict(os.environ, ROS_MASTER_URI=NO_MASTER), self.assertRaisesRegex(NodeError, "no ROS master"):
            Robot(7)

    def test_ctrl_c_ends_a_script_that_waits_for_a_silent_master(self):
        with socket.create_server(("localhost", 0)) as silent:
            uri = "http://localhost:%d" % silent.getsockname()[1]
            script = self.start("from hero_client import *; Robot(0)", ROS_MASTER_URI=uri)
            silent.settimeout(DEADLINE_S)
            connection, _ = silent.accept()
            self.addCleanup(connection.close)
            script.send_signal(signal.SIGINT)
            self.assertEqual((-signal.SIGINT, ""), self.end(script))


if __name__ == "__main__":
    rospy.init_node("test_robot_scripts")
    rostest.rosrun("hero_bringup", "robot_scripts", RobotScriptsTest, sys.argv)
