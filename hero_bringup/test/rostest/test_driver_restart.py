#!/usr/bin/env python3
"""The launch file as users start and end it: without robots, with a port in use, and again while robots wait."""

import signal
import sys
import unittest

import rosgraph
import rospy
import rostest
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry

from hero_msgs.msg import Robot, RobotArray
from hero_test.processes import Program, find_free_port, find_program, has_traceback
from hero_test.waiting import wait_for
from hero_test.watches.swarm_watch import SwarmWatch


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
                self.fleet and {robot.id for robot in self.fleet.robots if robot.state == Robot.READY} == set(numbers)
            ),
            lambda: "robots %s, last: %s" % (numbers, self.fleet),
        )

    def test_without_robots_it_starts_and_says_where_it_listens(self):
        program = self.launch()
        program.wait_for_text("listening on 127.0.0.1:%d" % self.port)
        self.wait_ready([])
        self.assertEqual(program.end(), 0)
        self.assertFalse(has_traceback(program.text()), program.lines)

    def test_simulated_robots_come_with_it_and_end_without_a_warning(self):
        program = self.launch("count:=2")
        self.wait_ready([0, 1])
        publisher = rospy.Publisher("/hero_0/cmd_vel", Twist, queue_size=1)
        watch = SwarmWatch([0])
        self.addCleanup(watch.close)
        command = Twist()
        command.linear.x = 0.1

        def drives():
            publisher.publish(command)
            return watch.rows[0] and watch.rows[0][-1][4] > 0.05

        wait_for(drives, "motion")
        self.assertEqual(program.end(), 0)
        # rospy warns of a subscriber that was told of a publisher twice at once, and left one connection.
        self.assertEqual(program.find_lines(r"\[(WARN|ERROR)\](?!.*Inbound TCP/IP connection failed)| left "), [])
        self.assertFalse(has_traceback(program.text()), program.lines)

    def test_robots_are_back_when_the_driver_is_started_again(self):
        odoms = []
        subscriber = rospy.Subscriber("/hero_4/odom", Odometry, odoms.append)
        self.addCleanup(subscriber.unregister)
        robots = Program(sys.executable, "-m", "hero_sim", "--count", "2", "--first-id", "4", "--port", str(self.port))
        self.addCleanup(robots.end)
        for _ in range(2):
            program = self.launch()
            self.wait_ready([4, 5])
            seen = len(odoms)
            wait_for(lambda s=seen: len(odoms) > s + 20, "odometry")
            self.assertEqual(program.end(), 0)
            self.fleet = None
        stamps = [message.header.stamp for message in odoms]
        self.assertEqual(stamps, sorted(stamps))

    def test_the_registration_of_a_dead_driver_hinders_no_start(self):
        command = (find_program("hero_driver", "hero_driver"), "_port:=%d" % self.port, "_host:=127.0.0.1")
        dead = Program(*command)
        dead.wait_for_text("listening on")
        dead.end(signal.SIGKILL)
        self.assertTrue(rosgraph.Master("/test").lookupNode("/hero_driver"))
        driver = Program(*command)
        self.addCleanup(driver.end)
        driver.wait_for_text("listening on")


if __name__ == "__main__":
    rospy.init_node("test_driver_restart")
    rostest.rosrun("hero_bringup", "driver_restart", DriverRestartTest)
