#!/usr/bin/env python3
"""Two drivers under one ROS master: programs find the robots of both, and a stop reaches both."""

import json
import os
import signal
import unittest

import rospy
import rostest
from geometry_msgs.msg import Twist

from hero_client.ros import Drivers
from hero_client.swarm import Swarm
from hero_monitor.background import Background
from hero_monitor.control.drive_requests import DriveRequests
from hero_test.processes import find_pid
from hero_test.program_terminal import ProgramTerminal, run_fleet
from hero_test.waiting import wait_for
from hero_test.watches.swarm_watch import SwarmWatch

IDS = [0, 1, 100, 101]
TIMEOUT_S = 60.0


def read_fleet(*arguments):
    """Return the fleet as JSON."""
    code, output, errors = run_fleet("--once", "--json", *arguments)
    assert code == 0, errors
    return json.loads(output)


class TwoDriversTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.watch = SwarmWatch(IDS)
        cls.watch.wait_until_complete(TIMEOUT_S)
        cls.publishers = [
            rospy.Publisher("/hero_%d/velocity_controller/cmd_vel" % number, Twist, queue_size=1) for number in IDS
        ]
        cls.drivers = Drivers()

        def all_are_ready():
            report = cls.drivers.read()
            return report and [robot.id for robot in report.robots if robot.state == robot.READY] == IDS

        wait_for(all_are_ready, "four robots that are ready")

    def drive(self, speed_m_s=0.05):
        """Tell all robots to drive, once."""
        command = Twist()
        command.linear.x, command.angular.z = speed_m_s, 0.5
        for publisher in self.publishers:
            publisher.publish(command)

    def is_moving(self, robot_id):
        return self.watch.rows[robot_id][-1][4] > 0.02

    def wait_until_all_move(self):
        def all_move():
            self.drive()
            return all(map(self.is_moving, IDS))

        wait_for(all_move, "motion of all")

    def wait_for_status(self, *expected):
        wait_for(lambda: self.drivers.stop_status() == expected, self.drivers.stop_status)

    def release(self):
        self.drivers.request_stop(False)
        self.wait_for_status("info", "released: robots may move again", True)

    def read_names(self):
        self.drivers.read()
        return self.drivers.names()

    def test_1_programs_find_the_robots_of_both(self):
        fleet = read_fleet()
        self.assertEqual([robot["id"] for robot in fleet["robots"]], IDS)
        self.assertEqual(fleet["listening"], "127.0.0.1:21340, 127.0.0.1:21341")
        swarm = Swarm.discover(TIMEOUT_S)
        self.assertEqual([robot.robot_id for robot in swarm], IDS)
        swarm.close()
        self.assertEqual(self.read_names(), ["/hero_driver", "/hero_driver_b"])
        self.assertEqual(self.drivers.find("/hero_101"), "/hero_driver_b")
        self.assertEqual(self.drivers.find("/hero_0"), "/hero_driver")

    def test_2_a_remapped_list_is_that_of_one_driver_alone(self):
        fleet = read_fleet("/hero_driver/robots:=/hero_driver_b/robots")
        self.assertEqual([robot["id"] for robot in fleet["robots"]], [100, 101])

    def test_3_the_keys_of_the_table_stop_the_robots_of_both_and_release_them(self):
        table = ProgramTerminal("hero_tools", "fleet")
        self.addCleanup(table.close)
        table.wait_for(b"4 of 4 robots ready")
        self.wait_until_all_move()
        table.press(b"s")
        # They are told to drive on, and stay.
        self.watch.wait_until_stopped_despite(self.drive, *IDS)
        table.wait_for(b"stopped, all wheels at rest")
        table.press(b"r")
        self.wait_until_all_move()
        table.press(b"q")
        self.assertEqual(table.wait_for_end(), 0)

    def test_4_the_stop_of_the_page_reaches_both(self):
        background = Background()
        self.addCleanup(background.shutdown)
        commander = DriveRequests(self.drivers, background)
        self.wait_until_all_move()
        commander.request_stop(True)
        self.assertFalse(commander.may_drive())
        self.watch.wait_until_stopped_despite(self.drive, *IDS)
        self.wait_for_status("info", "stopped, all wheels at rest", True)
        commander.close()
        self.release()

    def test_5_a_driver_that_died_without_a_word_is_not_waited_for(self):
        os.kill(find_pid("/hero_driver_b"), signal.SIGKILL)
        self.assertEqual([robot["id"] for robot in read_fleet()["robots"]], [0, 1])
        # Who listened before forgets its robots.
        wait_for(lambda: len(self.drivers.read().robots) == 2, "robots of the other driver alone")
        self.drivers.request_stop(True)
        self.wait_for_status("error", "NOT STOPPED: driver hero_driver_b does not answer", False)
        self.assertTrue(self.drivers.is_stopped("/hero_driver"))


if __name__ == "__main__":
    rospy.init_node("test_two_drivers")
    rostest.rosrun("hero_bringup", "test_two_drivers", TwoDriversTest)
