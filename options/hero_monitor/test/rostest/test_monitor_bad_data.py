#!/usr/bin/env python3
"""Numbers and log lines of one robot or program that are wrong: the page shows the others as before."""

import math
import unittest

import rospy
import rostest
from geometry_msgs.msg import Point, PoseStamped, Quaternion
from monitor_process import HOST, end, start_scripted_driver, wait_until_it_answers
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import LaserScan
from std_msgs.msg import ColorRGBA

from hero_test.screens.browser import MISSING
from hero_test.screens.monitor_page import MonitorPage
from hero_test.waiting import wait_for


def make_odometry(x_m, y_m):
    message = Odometry()
    message.pose.pose.position = Point(x_m, y_m, 0.0)
    message.pose.pose.orientation = Quaternion(0.0, 0.0, 0.0, 1.0)
    return message


def make_goal(x_m, y_m):
    goal = PoseStamped()
    goal.header.frame_id = "hero_1/odom"
    goal.pose.position = Point(x_m, y_m, 0.0)
    return goal


@unittest.skipIf(MISSING, "not installed: %s (script/bootstrap --test)" % ", ".join(MISSING))
class BadDataTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        wait_until_it_answers(HOST)
        cls.driver = start_scripted_driver("hero_driver", [0, 1], twin_of=0)
        cls.page = MonitorPage("http://%s/" % HOST)
        cls.page.open()
        cls.page.wait_for_text("#ready", "2 of 2")
        cls.good = cls.advertise("/hero_0/odom", Odometry)

    @classmethod
    def tearDownClass(cls):
        cls.page.close()
        end(cls.driver)

    @staticmethod
    def advertise(topic, message_class):
        publisher = rospy.Publisher(topic, message_class, queue_size=5)
        wait_for(publisher.get_num_connections, "listeners to " + topic)
        return publisher

    def wait_for_pose(self, robot, pose):
        self.page.choose(robot)

        def is_shown():
            return self.page.facts().get("pose", "").startswith(pose)

        wait_for(is_shown, self.page.facts)

    def check_that_others_are_shown(self, x_m):
        self.good.publish(make_odometry(x_m, 0.5))
        self.wait_for_pose("hero_0", "%.3f" % (x_m - 0.5))  # robots without a place on the map are drawn side by side
        # A map that draws for ever answers nothing.
        drawn = "const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(() => done(true)))"
        self.assertTrue(self.page.browser.execute_async_script(drawn))
        self.assertEqual(self.page.errors(), [])

    def test_a_pose_that_no_robot_can_have_is_shown_as_unknown(self):
        bad = self.advertise("/hero_1/odom", Odometry)
        for number, (x_m, y_m) in enumerate(((1e306, 0.0), (0.0, -1e12), (math.nan, 0.0), (0.0, math.inf))):
            bad.publish(make_odometry(0.25, 0.0))
            self.wait_for_pose("hero_1", "0.750")
            bad.publish(make_odometry(x_m, y_m))
            self.wait_for_pose("hero_1", "-")
            self.check_that_others_are_shown(0.1 * number)

    def test_other_numbers_that_make_no_sense_leave_the_page_as_it_is(self):
        self.advertise("/hero_1/odom", Odometry).publish(make_odometry(0.25, 0.0))
        self.wait_for_pose("hero_1", "0.750")
        goal = self.advertise("/hero_1/goal", PoseStamped)
        scan = self.advertise("/hero_1/proximity", LaserScan)
        color = self.advertise("/hero_1/led", ColorRGBA)
        for number, value in enumerate((1e38, -1e38, math.nan, math.inf)):
            goal.publish(make_goal(value * 1e260, value))
            scan.publish(LaserScan(ranges=[value] * 8))
            scan.publish(LaserScan(ranges=[0.1] * 10000, angle_increment=value))
            color.publish(ColorRGBA(value, value, value, value))
            self.check_that_others_are_shown(0.1 * number + 0.05)

    def find_source(self, node, text):
        """Publish a line until the page shows it; return from whom it is."""
        publisher = self.advertise("/rosout", Log)
        script = (
            "const line = [...document.querySelectorAll('#lines li')]"
            ".find(one => one.textContent.includes(arguments[0]));"
            "return line && line.querySelector('.node').textContent"
        )

        def is_shown():
            publisher.publish(Log(level=Log.INFO, name=node, msg=text))
            return self.page.browser.execute_script(script, text.rpartition(": ")[2])

        return wait_for(is_shown, text)

    def test_only_lines_of_a_driver_are_those_of_a_robot(self):
        self.assertEqual(self.find_source("/hero_driver", "hero_0: battery is low"), "hero_0")
        self.assertEqual(self.find_source("/random_walk", "hero_0: walks"), "random_walk")
        self.assertEqual(self.find_source("/hero_driver", "all but hero_0: stopped"), "hero_driver")

    def test_a_refused_robot_shows_nothing_of_the_one_with_its_name(self):
        self.good.publish(make_odometry(0.0, 0.0))
        wait_for(lambda: self.page.rows()[0]["Odom"] != "-", self.page.rows)
        refused = self.page.rows()[1]
        shown = {name: refused[name] for name in ("Robot", "State", "Stop", "Address", "Pose", "Odom")}
        self.assertEqual(list(shown.values()), ["hero_0", "REFUSED", "", "127.0.9.9:5", "-", "-"])


if __name__ == "__main__":
    rospy.init_node("test_monitor_bad_data")
    rostest.rosrun("hero_monitor", "test_monitor_bad_data", BadDataTest)
