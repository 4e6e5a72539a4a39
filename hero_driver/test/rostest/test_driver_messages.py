#!/usr/bin/env python3
"""What ROS programs get of what robots send: scans, odometry, transforms and stamps that can be trusted."""

import math
import struct

import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan, Range
from tf2_msgs.msg import TFMessage

from hero_msgs.msg import Encoder, Robot
from hero_msgs.srv import SetOdom
from hero_test import stock_messages
from hero_test.driver_case import DriverCase, DriverProcess, Recorder
from hero_test.fake_robot import STOCK_DECLARATIONS, FakeRobot, boot_line, encode_answer
from hero_test.stock_messages import TICK_M, send_burst
from hero_test.waiting import wait_for

STEP_S = 0.034
"""Between two bursts of the stock robot."""


def read_pose(message):
    """Return (x, y, yaw) of an odometry message."""
    pose = message.pose.pose
    return pose.position.x, pose.position.y, 2.0 * math.atan2(pose.orientation.z, pose.orientation.w)


class TestDriverMessages(DriverCase):
    def assert_pose(self, message, x_m, y_m, yaw_rad):
        for value, expected in zip(read_pose(message), (x_m, y_m, yaw_rad)):
            self.assertAlmostEqual(value, expected, 9)

    def drive(self, robot, readings, start=None, odoms=None):
        """Send a burst for each (left, right) with stamps in the stock rhythm; return the odometry messages."""
        odoms = odoms or Recorder(robot.namespace + "/odom", Odometry)
        before = len(odoms.messages)
        start = start or rospy.Time.now() - rospy.Duration(len(readings) * STEP_S)
        for index, (left, right) in enumerate(readings):
            send_burst(robot, left, right, start + rospy.Duration(index * STEP_S), x_m=0.4 * left * TICK_M)
        return odoms.wait_count(before + len(readings))[before:]

    def call_set_odom(self, robot, *pose):
        rospy.wait_for_service(robot.namespace + "/set_odom", 60.0)
        self.assertTrue(rospy.ServiceProxy(robot.namespace + "/set_odom", SetOdom)(*pose).success)

    # Scans.

    def test_laser_passes_byte_for_byte(self):
        robot = self.join(1)
        scans = Recorder("/hero_1/laser", rospy.AnyMsg)
        payloads = [
            stock_messages.make_laser("hero_1", rospy.Time(3, 5), [0.1 + 0.01 * index] * 8, seq=index)
            for index in range(3)
        ]
        for payload in payloads:
            robot.send("laser", payload)
        self.assertEqual([message._buff for message in scans.wait_count(3)], payloads)

    def test_a_scan_of_another_shape_passes_without_proximity(self):
        robot = self.join(3)
        scans = Recorder("/hero_3/laser", rospy.AnyMsg)
        proximity = Recorder("/hero_3/proximity", LaserScan)
        odd = stock_messages.to_bytes(LaserScan(ranges=[0.1] * 5))
        good = stock_messages.make_laser("hero_3", rospy.Time.now(), [0.1] * 8)
        for payload in (odd, b"\x01\x02", good):
            robot.send("laser", payload)
        proximity.wait_count(1)
        self.assertIn(odd, [message._buff for message in scans.wait_count(2)])
        self.assertEqual(len(proximity.messages), 1)
        self.fleet.wait("/hero_3", Robot.READY, "counted", lambda e: e.dropped_messages >= 1)

    # Odometry.

    def test_odom_follows_the_ticks_and_not_the_robots_own_estimate(self):
        robot = self.join(5)
        messages = self.drive(robot, [(5.0 * step, 5.0 * step) for step in range(31)])
        self.assert_pose(messages[-1], 150 * TICK_M, 0.0, 0.0)
        self.assertAlmostEqual(messages[-1].twist.twist.linear.x, 5 * TICK_M / STEP_S, 3)
        self.assertEqual(messages[-1].twist.twist.linear.y, 0.0)
        header = messages[-1].header
        self.assertEqual((header.frame_id, messages[-1].child_frame_id), ("hero_5/odom", "hero_5/base_link"))

    def test_set_odom_sets_the_pose_without_a_jump(self):
        robot = self.join(9)
        odoms = Recorder("/hero_9/odom", Odometry)
        self.drive(robot, [(10.0 * step, 10.0 * step) for step in range(10)], odoms=odoms)
        self.call_set_odom(robot, 1.0, -2.0, math.pi / 2)
        # The robot has zeroed its counters.
        messages = self.drive(robot, [(10.0 * step, 10.0 * step) for step in range(10)], odoms=odoms)
        self.assert_pose(messages[0], 1.0, -2.0, math.pi / 2)
        self.assert_pose(messages[-1], 1.0, -2.0 + 90 * TICK_M, math.pi / 2)
        self.call_set_odom(robot, 0.0, 0.0, 0.0)
        self.assert_pose(self.drive(robot, [(0.0, 0.0)], odoms=odoms)[0], 0.0, 0.0, 0.0)

    def test_a_reboot_leaves_the_pose_where_it_was(self):
        robot = self.join(11)
        odoms = Recorder("/hero_11/odom", Odometry)
        self.drive(robot, [(10.0 * step, 10.0 * step) for step in range(11)], odoms=odoms)
        robot.close()
        self.fleet.wait("/hero_11", Robot.AWAY)
        rebooted = FakeRobot(11)
        self.addCleanup(rebooted.close)
        rebooted.declares = False
        rebooted.connect(self.address)
        rebooted.log(boot_line("hero_11"))
        rebooted.declares = True
        self.fleet.wait_ready("/hero_11")
        messages = self.drive(rebooted, [(0.0, 0.0), (10.0, 10.0)], odoms=odoms)
        self.assert_pose(messages[0], 100 * TICK_M, 0.0, 0.0)
        self.assert_pose(messages[1], 110 * TICK_M, 0.0, 0.0)

    def test_a_set_odom_that_is_answered_too_late_still_counts(self):
        robot = self.join(27)
        odoms = Recorder("/hero_27/odom", Odometry)
        self.drive(robot, [(0.0, 0.0), (50.0, 50.0)], odoms=odoms)
        robot.answers["set_odom"] = lambda _: None
        rospy.wait_for_service("/hero_27/set_odom", 60.0)
        with self.assertRaisesRegex(rospy.ServiceException, r"was not answered within 8\.0 s.*~service_timeout_s"):
            rospy.ServiceProxy("/hero_27/set_odom", SetOdom)(3.0, 4.0, 0.0)
        robot.answer("set_odom", encode_answer(True, "late"))
        self.assert_pose(self.drive(robot, [(10.0, 10.0)], odoms=odoms)[0], 3.0 + 10 * TICK_M, 4.0, 0.0)

    # HeRo+.

    def test_hero_plus_gets_its_ticks_stock_encoder_messages_and_ranges(self):
        changed = {
            "imu": ("/{}/distance", "std_msgs/Float32", "73fcbf46b49191e672908e50842a83d4"),
            "encoder": ("/{}/encoder", "hero_common/Encoder", "ec5c02e99365233af779a0f9f54cb0df"),
        }
        declared = []
        for entry in STOCK_DECLARATIONS:
            name, message_type, md5sum = changed.get(entry.name.rpartition("/")[2], entry[2:5])
            declared.append(entry._replace(name=name, message_type=message_type, md5sum=md5sum))
        robot = self.join(28, declarations=declared)
        encoders, ranges = Recorder("/hero_28/encoder", Encoder), Recorder("/hero_28/range", Range)
        odoms = Recorder("/hero_28/odom", Odometry)
        start = rospy.Time.now()
        for index, ticks in enumerate((0.0, 10.0)):
            stamp = start + rospy.Duration(index * STEP_S)
            robot.send("odom", stock_messages.make_odom("hero_28", stamp))
            stock = stock_messages.make_encoder("hero_28", stamp, ticks, ticks)
            robot.send("encoder", stock[:-40] + bytes(8) + stock[-40:])
        robot.send("distance", struct.pack("<f", 0.5))
        self.assertEqual([message.left_ticks for message in encoders.wait_count(2)], [0.0, 10.0])
        self.assert_pose(odoms.wait_count(2)[1], 10 * math.pi * 0.050 / 96, 0.0, 0.0)
        self.assertEqual(ranges.wait_count(1)[0].range, 0.5)
        self.fleet.wait("/hero_28", Robot.READY, "as hero_plus", lambda entry: entry.model == "hero_plus")

    # Stamps.

    def test_uptime_and_future_stamps_are_replaced_by_the_arrival(self):
        robot = self.join(17)
        encoders = Recorder("/hero_17/encoder", Encoder)
        odoms = Recorder("/hero_17/odom", Odometry)
        for stamp in (rospy.Time(2, 34000000), rospy.Time.now() + rospy.Duration(30.0)):
            earliest = rospy.Time.now()
            before = len(encoders.messages)
            send_burst(robot, 0.0, 0.0, stamp)
            for recorder in (encoders, odoms):
                arrived = recorder.wait_count(before + 1)[before].header.stamp
                self.assertLessEqual(earliest, arrived)
                self.assertLessEqual(arrived, rospy.Time.now())

    # Transforms.

    def test_every_transform_of_every_robot_comes_out_in_fewer_messages(self):
        robots = [self.join(number) for number in (20, 21, 22)]
        transforms = Recorder("/tf", TFMessage)
        start = rospy.Time.now() - rospy.Duration(40 * STEP_S)
        expected = set()
        for step in range(40):
            stamp = start + rospy.Duration(step * STEP_S)
            for robot in robots:
                send_burst(robot, 0.0, 0.0, stamp)
                expected |= {("%s/%s" % (robot.name, child), stamp) for _, child in stock_messages.FRAMES}
        names = tuple(robot.name + "/" for robot in robots)

        def list_received():
            return [
                (transform.child_frame_id, transform.header.stamp)
                for message in list(transforms.messages)
                for transform in message.transforms
                if transform.child_frame_id.startswith(names)
            ]

        wait_for(
            lambda: len(list_received()) >= len(expected),
            lambda: "%d transforms, got %d" % (len(expected), len(list_received())),
        )
        self.assertEqual(len(list_received()), len(expected))
        self.assertEqual(set(list_received()), expected)
        self.assertLess(len(transforms.messages), len(expected) / 2)

    def test_foreign_transforms_are_dropped_counted_and_reported(self):
        robot = self.join(23)
        transforms = Recorder("/tf", TFMessage)
        diagnostics = Recorder("/diagnostics", DiagnosticArray)
        foreign = (
            ("map", "hero_23/odom"),
            ("hero_24/odom", "hero_24/base_link"),
            ("hero_23/odom", "hero_2/base_link"),
            ("hero_23/base_link", "hero_230/base_link"),
        )
        for parent, child in foreign:
            robot.send("/tf", stock_messages.make_transform(parent, child, rospy.Time.now()))
        send_burst(robot, 0.0, 0.0)
        self.fleet.wait("/hero_23", Robot.READY, "counted", lambda e: e.dropped_messages == len(foreign))

        def list_frames():
            return [
                (transform.header.frame_id, transform.child_frame_id)
                for message in list(transforms.messages)
                for transform in message.transforms
            ]

        wait_for(lambda: ("hero_23/base_link", "hero_23/laser_link") in list_frames(), "its own transforms")
        self.assertEqual(set(list_frames()) & set(foreign), set())
        wait_for(
            lambda: any(
                "transforms that are not its own" in status.message and "map" in status.message
                for message in list(diagnostics.messages)
                for status in message.status
            ),
            "a report in diagnostics",
        )

    # Parameters.

    def test_parameters_choose_covariances(self):
        parameters = {
            "pose_covariance": [1, 2, 3, 4, 5, 6],
            "twist_covariance": [6.0, 5.0, 4.0, 3.0, 2.0, 1.0],
        }
        with DriverProcess(parameters) as driver:
            robot = FakeRobot(30)
            self.addCleanup(robot.close)
            robot.connect(driver.address)
            driver.fleet.wait_ready("/hero_30")
            odoms = Recorder("/hero_30/odom", Odometry)
            send_burst(robot, 0.0, 0.0, rospy.Time.now())
            message = odoms.wait_count(1)[0]
            self.assertEqual([message.pose.covariance[index * 7] for index in range(6)], [1, 2, 3, 4, 5, 6])
            self.assertEqual([message.twist.covariance[index * 7] for index in range(6)], [6, 5, 4, 3, 2, 1])


if __name__ == "__main__":
    rospy.init_node("test_driver_messages")
    rostest.rosrun("hero_driver", "driver_messages", TestDriverMessages)
