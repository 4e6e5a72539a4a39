#!/usr/bin/env python3
"""A stop of all robots while a driver hangs, while the ROS master hangs, and what people see of it."""

import math
import signal
import socket
import subprocess
import threading
import unittest
import xmlrpc.client
from unittest import mock

import rosgraph
import rospy
import rostest
from sensor_msgs.msg import Joy

from hero_client.ros import Drivers
from hero_client.swarm import Swarm
from hero_msgs.msg import RobotArray
from hero_node import NodeError
from hero_node.ros.ros_node import start_ros_node
from hero_test.processes import ExampleProgram, find_pid, find_program, suspended
from hero_test.program_terminal import ProgramTerminal
from hero_test.waiting import wait_for

AT_REST = ("info", "stopped, all wheels at rest", True)
RELEASED = ("info", "released: robots may move again", True)
HUNG = ("error", "NOT STOPPED: driver hero_driver_b does not answer", False)


class Reports:
    """The newest report of a driver, over a connection of the test's own."""

    def __init__(self, driver):
        self.newest = None
        self._subscriber = rospy.Subscriber(driver + "/robots", RobotArray, self._receive, tcp_nodelay=True)

    def _receive(self, report):
        self.newest = report

    @property
    def requests(self):
        return int(self.newest.listening.rpartition(":")[2])


def connect_without_header():
    """Return a connection to this node's publishers by a program that hangs before it has sent its header."""
    node = xmlrpc.client.ServerProxy(rospy.get_node_uri())
    _, _, (_, host, port) = node.requestTopic("/test", "/rosout", [["TCPROS"]])
    hung = socket.create_connection((host, port))
    hung.sendall(b"\0\0")
    return hung


class StopRequestTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.reports = {driver: Reports(driver) for driver in ("/hero_driver", "/hero_driver_b")}
        wait_for(lambda: all(reports.newest for reports in cls.reports.values()), "both drivers")
        cls.healthy = cls.reports["/hero_driver"]
        cls.drivers = Drivers()
        wait_for(lambda: len(cls.drivers.names()) == 2, "drivers that are found")
        cls.master_pid, cls.hung_pid = rosgraph.Master("/test").getPid(), find_pid("/hero_driver_b")

    def setUp(self):
        def release():
            self.drivers.request_stop(False)
            return self.drivers.wait_for_stop() == RELEASED

        wait_for(release, self.drivers.stop_status)

    def wait_for_report(self, stopped):
        """Wait until the drivers report this: others were told of it over connections of their own."""
        wait_for(lambda: self.drivers.read().stopped == stopped, "stopped: %s" % stopped)

    def wait_until_named(self, driver):
        """Wait until who waits for the stop is told that this driver does not answer."""
        wait_for(
            lambda: "driver %s does not answer" % driver in self.drivers.wait_for_stop().text, self.drivers.stop_status
        )

    def open_table(self):
        table = ProgramTerminal("hero_tools", "fleet")
        self.addCleanup(table.close)
        table.wait_for(b"2 of 2 robots ready")
        return table

    def test_a_hung_driver_is_named_and_stopped_when_it_goes_on(self):
        with suspended(self.hung_pid):
            self.drivers.request_stop(True)
            self.wait_until_named("hero_driver_b")
            wait_for(lambda: self.drivers.stop_status() == HUNG, self.drivers.stop_status)
            wait_for(lambda: self.healthy.newest.stopped, "the stop of the healthy driver")
            wait_for(self.drivers.find_silent, "the silence of the hung driver")
            self.assertFalse(self.drivers.read().stopped, "stopped, though a driver does not answer")
        wait_for(lambda: self.drivers.stop_status() == AT_REST, "the stop of the driver that hung")

    def test_a_driver_that_starts_while_another_is_asked_is_stopped_too(self):
        reports = Reports("/hero_driver_c")
        with suspended(self.hung_pid), connect_without_header(), connect_without_header():
            self.drivers.request_stop(True)
            self.wait_until_named("hero_driver_b")
            wait_for(lambda: self.drivers.stop_status() == HUNG, self.drivers.stop_status)
            program = find_program("hero_test", "scripted_driver")
            driver = subprocess.Popen([program, "__name:=hero_driver_c", "_ids:='[2]'"])
            try:
                wait_for(lambda: reports.newest and reports.newest.stopped, "the stop of the new driver")
            finally:
                driver.terminate()
                driver.wait()

    def test_every_one_of_ten_presses_reaches_the_healthy_driver(self):
        with suspended(self.hung_pid, self.master_pid):
            for _ in range(10):
                before = self.healthy.requests
                self.drivers.request_stop(True)
                wait_for(lambda before=before: self.healthy.requests > before, "a request")
            self.wait_until_named("hero_driver_b")
            wait_for(lambda: self.drivers.stop_status() == HUNG, self.drivers.stop_status)

    def test_the_key_s_stops_though_the_master_and_a_driver_hang(self):
        table = self.open_table()
        with suspended(self.hung_pid, self.master_pid):
            table.press(b"s")
            wait_for(lambda: self.healthy.newest.stopped, "the stop of the healthy driver")
            table.wait_for(b"stopping")
            table.wait_for(b"\x1b[1;31mNOT STOPPED: driver hero_driver_b does not answer")
            table.wait_for_next(b"hero_driver_b does not answer, driver listens")
        table.wait_for_next(b"stopped, all wheels at rest")
        table.wait_for_next(b"STOPPED, at rest")
        table.wait_for_next(b"ALL STOPPED")
        table.press(b"r")
        table.wait_for_next(b"released: robots may move again")
        wait_for(lambda: not self.healthy.newest.stopped, "the release")
        table.press(b"q")
        self.assertEqual(table.wait_for_end(), 0)

    def test_fleet_ends_while_the_master_hangs_and_names_who_is_not_stopped(self):
        table = self.open_table()
        with suspended(self.hung_pid, self.master_pid):
            # A report that was on its way would be taken for an answer.
            table.wait_for_next(b"driver hero_driver_b does not answer")
            table.press(b"sq")
            self.assertEqual(table.wait_for_end(), 1)
            table.wait_for(b"fleet: NOT STOPPED: driver hero_driver_b does not answer")
        self.assertEqual(table.settings(), table.settings_before)

    def test_signals_end_fleet_and_give_the_terminal_back(self):
        for number in (signal.SIGHUP, signal.SIGTERM, signal.SIGINT):
            table = self.open_table()
            self.assertNotEqual(table.settings(), table.settings_before)
            table.process.send_signal(number)
            self.assertEqual(table.wait_for_end(), 128 + number)
            self.assertEqual(table.settings(), table.settings_before)
            table.wait_for(b"\x1b[?1049l")

    def test_teleop_stops_all_robots_and_says_why_its_own_does_not_move(self):
        teleop = ProgramTerminal("hero_examples", "teleop", "_robots:=0")
        self.addCleanup(teleop.close)
        teleop.wait_for(b"Enter: STOP ALL ROBOTS")
        teleop.press(b"\r")
        teleop.wait_for(b"stopped, all wheels at rest: r releases them")
        self.wait_for_report(True)
        teleop.press(b"w")
        teleop.wait_for(b"all robots are stopped by teleop")
        teleop.wait_for(b", so hero_0 cannot move: r releases them\r\n")
        with suspended(self.hung_pid, self.master_pid):
            teleop.press(b"\r")
            teleop.wait_for(b"\x1b[1;31mhero_0 | NOT STOPPED: driver hero_driver_b does not answer")
        teleop.press(b"r")
        wait_for(lambda: not self.healthy.newest.stopped, "the release")
        teleop.press(b"\x04")
        self.assertEqual(teleop.wait_for_end(), 0)

    def test_a_button_of_the_joystick_stops_all_robots(self):
        joystick = rospy.Publisher("/joy", Joy, queue_size=10)
        teleop = ExampleProgram("teleop_joy", "_robots:=0")
        self.addCleanup(teleop.close)
        wait_for(lambda: joystick.get_num_connections() > 0, "teleop_joy")
        joystick.publish(Joy(axes=[math.nan, 1.0], buttons=[0, 0, 0, 0, 1]))
        teleop.wait_for_text("not finite")
        for is_pressed in (0, 1, 0):  # so short a press must not be missed
            joystick.publish(Joy(axes=[math.nan, 1.0], buttons=[0, is_pressed, 0, 0, 1]))
        teleop.wait_for_text("stopped, all wheels at rest")
        self.wait_for_report(True)
        teleop.wait_for_text("let go, then press again")
        for is_enabled in (0, 1):
            joystick.publish(Joy(axes=[0.0, 1.0], buttons=[0, 0, 0, 0, is_enabled]))
        teleop.wait_for_text("hero_0 does not move: the driver hero_driver has stopped all robots")
        self.assertEqual(teleop.end(), 0)
        self.assertEqual(teleop.text().count("not finite"), 1, teleop.text())

    def test_a_swarm_stops_and_releases_all_robots(self):
        with Swarm([0], odom=False, proximity=False) as swarm:
            # A machine that stands still for a moment must not fail the test: the first answer may be too early.
            wait_for(lambda: swarm.emergency_stop() == AT_REST, swarm.drivers.stop_status)
            self.wait_for_report(True)
            wait_for(lambda: swarm.release_stop() == RELEASED, swarm.drivers.stop_status)
            self.wait_for_report(False)

    def test_drivers_are_unknown_until_the_master_has_answered(self):
        known = set(threading.enumerate())
        settled = []

        def refuse(*arguments):
            if threading.current_thread() not in known:
                settled.append(listener.is_settled if settled else None)
            raise NodeError("no ROS master")

        with suspended(find_pid("/hero_driver")), mock.patch("hero_client.ros.drivers.ask_master", refuse):
            listener = Drivers()
            self.addCleanup(listener.close)
            wait_for(lambda: len(settled) >= 2, "a second look")
        self.assertFalse(settled[1])
        wait_for(lambda: listener.is_settled, "reports of both drivers")
        self.assertEqual(listener.names(), ["/hero_driver", "/hero_driver_b"])


if __name__ == "__main__":
    start_ros_node("test_stop_request")
    rostest.rosrun("hero_bringup", "test_stop_request", StopRequestTest)
