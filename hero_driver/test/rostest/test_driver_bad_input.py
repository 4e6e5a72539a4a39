#!/usr/bin/env python3
"""What bad input gets: one clear line and an exit code from the node, a counter and nothing else from a robot."""

import select
import socket
import time
from pathlib import Path

import rosgraph
import rospy
import rostest
from std_srvs.srv import SetBool

from hero_msgs.msg import Encoder
from hero_node.ros.handshakes import HANDSHAKE_TIMEOUT_S
from hero_test import stock_messages
from hero_test.driver_case import (
    DriverProcess,
    OwnDriverCase,
    Recorder,
    list_driver_topics,
)
from hero_test.fake_robot import FakeRobot
from hero_test.waiting import wait_for

USAGE_ERROR = 2


class TestDriverBadInput(OwnDriverCase):
    def assert_start_fails(self, parameters, *parts):
        """The node must end with an exit code and one line that holds all parts."""
        driver = DriverProcess(parameters)
        self.addCleanup(driver.fleet.close)
        self.assertEqual(driver.wait_end(), USAGE_ERROR, driver.lines)
        self.assertEqual(len(driver.lines), 1, driver.lines)
        for part in ("FATAL", "hero_driver cannot start: ", *parts):
            self.assertIn(part, driver.lines[0])

    # Parameters.

    def test_a_port_in_use_is_named_with_a_remedy(self):
        with socket.socket() as taken:
            taken.bind(("127.0.0.1", 0))
            taken.listen(1)
            port = taken.getsockname()[1]
            self.assert_start_fails(
                {"host": "127.0.0.1", "port": port},
                "~host 127.0.0.1, ~port %d is in use" % port,
                "another ~port",
            )

    def test_an_address_that_yaml_reads_as_no_text_is_refused_in_one_line(self):
        driver = DriverProcess(arguments=["_host:=::"])
        self.addCleanup(driver.fleet.close)
        self.assertEqual(driver.wait_end(), USAGE_ERROR, driver.lines)
        self.assertEqual(len(driver.lines), 1, driver.lines)
        self.assertIn("quote it twice, as in _host:='\"::\"'", driver.lines[0])

    def test_an_environment_in_which_ros_cannot_start_is_named_in_one_line(self):
        for name, value, part in (
            ("ROS_MASTER_URI", "http://localhost:99999", "http://localhost:11311"),
            ("ROS_LOG_DIR", __file__, "ROS_LOG_DIR"),
        ):
            driver = DriverProcess(environment={name: value})
            self.addCleanup(driver.fleet.close)
            self.assertEqual(driver.wait_end(), USAGE_ERROR, driver.lines)
            self.assertEqual(len(driver.lines), 1, driver.lines)
            for text in ("hero_driver cannot start: ", value, part):
                self.assertIn(text, driver.lines[0])

    # Bytes.

    def dial_pair(self, number):
        """A driver, a robot that will misbehave, and one that must not notice."""
        driver = self.share()
        bad, good = self.dial(driver, number), self.dial(driver, 2)
        return driver, bad, good

    def assert_alive(self, robot, ticks=5.0):
        """What a robot sends arrives, over the connection that it has."""
        encoders = Recorder(robot.namespace + "/encoder", Encoder)
        robot.send("encoder", stock_messages.make_encoder(robot.name, rospy.Time.now(), ticks, ticks))
        self.assertEqual(encoders.wait_count(1)[0].left_ticks, ticks)
        self.assertTrue(robot.is_connected)

    def test_a_program_that_does_not_speak_rosserial_is_disconnected(self):
        driver, _, good = self.dial_pair(36)
        other_program = FakeRobot(9, declarations=[])
        self.addCleanup(other_program.close)
        other_program.is_silent = True
        other_program.declares = False
        other_program.connect(driver.address)
        other_program.send_bytes(b"GET / HTTP/1.1\r\nHost: robot\r\n\r\n" * 4000)
        wait_for(lambda: other_program.ended, "the end of the connection")
        driver.wait_line("127.0.0.1:.*does not speak rosserial")
        self.assert_alive(good)

    # Programs that connect.

    def test_half_open_connections_keep_no_program_out(self):
        driver = self.start()
        robot = self.dial(driver, 1)
        stop = rospy.ServiceProxy(driver.node + "/stop", SetBool)
        stop(False)
        # Each topic that is still to be registered would be a file more.
        wait_for(lambda: len(list_driver_topics("/hero_1", driver.node)) == 19, "all topics and services")
        files = Path("/proc/%d/fd" % driver.process.pid)
        before = len(list(files.iterdir()))
        uri = rosgraph.Master("/test").lookupService(driver.node + "/stop")
        port = rospy.core.parse_rosrpc_uri(uri)[1]
        start_s = time.monotonic()
        waiting = [socket.create_connection(("127.0.0.1", port), 60.0) for _ in range(100)]
        for connection in waiting:
            connection.sendall(b"\x10\x00")
        # Answered, and heard, while all of them still wait: none is closed before its time.
        self.assertTrue(stop(False).success)
        self.assert_alive(robot)
        closed = select.select(waiting, [], [], 0.0)[0]
        self.assertTrue(not closed or time.monotonic() - start_s > HANDSHAKE_TIMEOUT_S)
        wait_for(lambda: len(list(files.iterdir())) <= before + 10, "the driver to close what waits")
        for connection in waiting:
            self.assertEqual(connection.recv(1), b"")
            connection.close()


if __name__ == "__main__":
    rospy.init_node("test_driver_bad_input")
    rostest.rosrun("hero_driver", "driver_bad_input", TestDriverBadInput)
