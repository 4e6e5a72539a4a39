#!/usr/bin/env python3
"""The program check: beside a driver and two simulated robots, and in each of the usual broken conditions."""

import json
import os
import socket
import subprocess
import unittest

import rosgraph
import rospy
import rostest
from geometry_msgs.msg import Twist

from hero_test.processes import find_program
from hero_test.watches.fleet_report import wait_until_ready

DEADLINE_S = 60.0  # check itself ends after 3 s; a machine that is busy may take longer
PORT = "21290"
NO_SUCH_NAME = "no-such-pc.invalid"  # RFC 2606


def run_check(*arguments, **environment):
    """Return the exit code and the findings by point; an environment variable that is None is not there."""
    variables = {**os.environ, **environment}
    result = subprocess.run(
        [find_program("hero_tools", "check"), "--json", "--port", PORT, *arguments],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        env={name: value for name, value in variables.items() if value is not None},
        timeout=DEADLINE_S,
        check=False,
    )
    answer = json.loads(result.stdout.decode())
    assert answer["ok"] == (result.returncode == 0)
    return result.returncode, {point["point"]: point for point in answer["points"]}


class CheckTest(unittest.TestCase):
    def assert_point(self, points, name, state, text):
        """The point is in this state, says so, and has a remedy if it is not OK."""
        point = points[name]
        self.assertEqual(point["state"], state, point)
        self.assertIn(text, point["text"])
        self.assertEqual(bool(point["remedy"]), state != "OK", point)

    def test_all_that_runs_is_found_and_connects_both_ways(self):
        wait_until_ready(0, 1)
        code, points = run_check()
        self.assertEqual(code, 0, points)
        self.assert_point(points, "robots", "OK", "2 of 2 robots ready, the driver listens on 127.0.0.1:21290")
        self.assert_point(points, "master", "OK", rosgraph.get_master_uri())
        self.assert_point(points, "return_path", "OK", "can connect")
        self.assert_point(points, "port", "OK", "the driver listens on 127.0.0.1:21290")
        self.assert_point(points, "addresses", "WARN", "open on 127.0.0.1 only")
        self.assert_point(points, "packages", "OK", "all of version")
        self.assert_point(points, "diagnostics", "OK", "without a problem")

    def test_commands_that_no_robot_hears_are_named(self):
        mine = [rospy.Publisher(topic, Twist, queue_size=1) for topic in ("/hero_0/led", "/hero_1/velocity")]
        _, points = run_check()
        self.assert_point(points, "commands", "WARN", "commands are lost")
        led, twist = points["commands"]["remedy"]
        self.assertIn("/hero_0/led as geometry_msgs/Twist, but robots take std_msgs/ColorRGBA", led)
        self.assertIn("did you mean /hero_1/velocity_controller/cmd_vel?", twist)
        for publisher in mine:
            publisher.unregister()

    def test_a_name_that_others_cannot_resolve_closes_the_return_path(self):
        code, points = run_check(ROS_HOSTNAME=NO_SUCH_NAME)
        self.assertEqual(code, 1)
        self.assert_point(points, "own_name", "FAIL", NO_SUCH_NAME)
        self.assert_point(points, "return_path", "FAIL", "did not connect")

    def test_a_log_folder_that_is_a_file_is_found_and_the_rest_is_looked_at(self):
        code, points = run_check(ROS_LOG_DIR=__file__)
        self.assertEqual(code, 1)
        self.assert_point(points, "node", "FAIL", __file__)
        self.assertIn("ROS_LOG_DIR", points["node"]["remedy"][0])
        self.assertIn("skipped", points["robots"]["text"])
        self.assert_point(points, "master", "OK", "answers")

    def test_a_missing_master_is_a_failure_and_the_rest_is_looked_at(self):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        code, points = run_check(ROS_MASTER_URI="http://localhost:%d" % port)
        self.assertEqual(code, 1, points)
        self.assert_point(points, "master", "FAIL", "no ROS master at 'http://localhost:%d'" % port)
        self.assertIn("roslaunch hero_bringup hero_bringup.launch", points["master"]["remedy"][0])
        self.assertIn("skipped", points["robots"]["text"])
        self.assert_point(points, "packages", "OK", "all of version")

    def test_a_master_that_takes_the_call_and_never_answers_holds_nothing_up(self):
        with socket.socket() as silent:
            silent.bind(("127.0.0.1", 0))
            silent.listen(20)
            code, points = run_check(ROS_MASTER_URI="http://localhost:%d" % silent.getsockname()[1])
        self.assert_point(points, "master", "FAIL", "no answer within")
        self.assertEqual(code, 1)


if __name__ == "__main__":
    rospy.init_node("test_check")
    rostest.rosrun("hero_tools", "test_check", CheckTest)
