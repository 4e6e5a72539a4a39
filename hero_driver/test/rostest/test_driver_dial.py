#!/usr/bin/env python3
"""Robots that are TCP servers: the driver dials them, and dials again while they are away."""

import socket

import rospy
import rostest
from std_msgs.msg import ColorRGBA

from hero_msgs.msg import Encoder, Robot
from hero_test import stock_messages
from hero_test.driver_case import OwnDriverCase, Recorder, make_publisher, wait_payloads
from hero_test.fake_robot import FakeRobot


def listen(port=0):
    """Return a listening socket; with a port, one that was used before."""
    listener = socket.socket()
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    listener.bind(("127.0.0.1", port))
    listener.listen(5)
    listener.settimeout(60.0)
    return listener


def port_of(listener):
    return listener.getsockname()[1]


class TestDriverDial(OwnDriverCase):
    def listen(self, port=0):
        listener = listen(port)
        self.addCleanup(listener.close)
        return listener

    def accept(self, listener, number):
        robot = FakeRobot(number)
        self.addCleanup(robot.close)
        return robot.accept(listener)

    def test_listed_robots_are_dialled_and_work_like_others(self):
        listeners = [self.listen(), self.listen()]
        robots = [{"host": "127.0.0.1", "port": port_of(listener)} for listener in listeners]
        driver = self.start(robots=robots)
        for number, listener in enumerate(listeners, 1):
            robot = self.accept(listener, number)
            entry = driver.fleet.wait_ready(robot.namespace)
            self.assertEqual(entry.address, "127.0.0.1:%d" % port_of(listener))
            encoders = Recorder(robot.namespace + "/encoder", Encoder)
            robot.send("encoder", stock_messages.make_encoder(robot.name, rospy.Time.now(), 3.0, 3.0))
            encoders.wait_count(1)
            make_publisher(robot.namespace + "/led", ColorRGBA).publish(ColorRGBA(1.0, 0.0, 0.0, 1.0))
            wait_payloads(robot, "led")
        # Robots that dial in are served by the same driver.
        self.dial(driver, 3)

    def test_a_robot_that_goes_away_is_dialled_again_and_keeps_its_topics(self):
        listener = self.listen()
        driver = self.start(robots=[{"host": "127.0.0.1", "port": port_of(listener)}])
        robot = self.accept(listener, 1)
        driver.fleet.wait_ready("/hero_1")
        encoders = Recorder("/hero_1/encoder", Encoder)
        for count in range(1, 4):
            robot.close()
            robot = self.accept(listener, 1)
            driver.fleet.wait("/hero_1", Robot.READY, "again", lambda e, n=count: e.reconnects == n)
            robot.send("encoder", stock_messages.make_encoder("hero_1", rospy.Time.now(), float(count), 0.0))
            encoders.wait_count(count)

    def test_an_unreachable_robot_is_reported_once_and_served_when_it_comes(self):
        with listen() as unused:
            port = port_of(unused)
        driver = self.start(robots=[{"host": "127.0.0.1", "port": port}])
        line = driver.wait_line("127.0.0.1:%d cannot be reached" % port)
        self.assertIn("Connection refused", line)
        self.assertIn("~robots", line)
        robot = self.accept(self.listen(port), 1)
        driver.fleet.wait_ready(robot.namespace)
        self.assertEqual(len(driver.find_lines("cannot be reached")), 1)

    def test_a_robot_that_cannot_be_looked_up_does_not_keep_others_waiting(self):
        listener = self.listen()
        driver = self.start(
            robots=[
                {"host": "10.42.0..1", "port": 11411},
                {"host": "no-such-robot.invalid", "port": 11411},
                {"host": "127.0.0.1", "port": port_of(listener)},
            ]
        )
        self.accept(listener, 2)
        driver.fleet.wait_ready("/hero_2")
        for host in ("10.42.0..1", "no-such-robot.invalid"):
            driver.wait_line("%s:11411 cannot be reached: '%s' cannot be found" % (host, host))
        # The one that was there is dialled again too.
        self.assertEqual(driver.find_lines("Traceback|made a mistake"), [])

    def test_a_driver_that_only_dials_listens_nowhere(self):
        listener = self.listen()
        driver = self.start(host="", robots=[{"host": "127.0.0.1", "port": port_of(listener)}])
        self.accept(listener, 1)
        driver.fleet.wait_ready("/hero_1")
        self.assertEqual(driver.fleet.newest.listening, "")


if __name__ == "__main__":
    rospy.init_node("test_driver_dial")
    rostest.rosrun("hero_driver", "driver_dial", TestDriverDial)
