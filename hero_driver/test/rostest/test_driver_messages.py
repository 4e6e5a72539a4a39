#!/usr/bin/env python3
"""What ROS programs get of what robots send: scans, odometry, transforms and stamps that can be trusted."""

import math
import struct

import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, LaserScan, Range
from tf2_msgs.msg import TFMessage

from hero_msgs.msg import Encoder, Robot
from hero_msgs.srv import SetOdom
from hero_test import stock_messages
from hero_test.driver_case import DriverCase, DriverProcess, Recorder
from hero_test.fake_robot import STOCK_DECLARATIONS, FakeRobot, boot_line, encode_answer, heartbeat_line
from hero_test.nonempty import nonempty
from hero_test.stock_messages import TICK_M, WHEEL_SEPARATION_M, send_burst
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

    def test_proximity_holds_the_eight_real_beams_by_rep_117(self):
        robot = self.join(2)
        scans = Recorder("/hero_2/proximity", LaserScan)
        stamp = rospy.Time.now()
        beams_m = [0.10, 0.2568, 0.0468, math.nan, 0.15, 0.2367, 0.06, 0.2368]
        robot.send("laser", stock_messages.make_laser("hero_2", stamp, beams_m))
        scan = scans.wait_count(1)[0]
        self.assertEqual((scan.header.stamp, scan.header.frame_id), (stamp, "hero_2/laser_link"))
        self.assertAlmostEqual(scan.angle_min, -math.pi, 5)
        self.assertAlmostEqual(scan.angle_increment, math.pi / 4, 6)
        self.assertAlmostEqual(scan.angle_max, scan.angle_min + 7 * scan.angle_increment, 5)
        self.assertGreater(scan.scan_time, 0.0)
        self.assertEqual(len(scan.ranges), 8)
        expected_m = [0.10, math.inf, -math.inf, math.nan, 0.15, None, 0.06, math.inf]
        for index, (range_m, expected) in enumerate(zip(scan.ranges, expected_m)):
            if expected is not None and math.isnan(expected):
                self.assertTrue(math.isnan(range_m), index)
            elif expected is not None:
                self.assertAlmostEqual(range_m, expected, 6, index)
        for range_m in scan.ranges:
            if math.isfinite(range_m):
                self.assertTrue(scan.range_min <= range_m <= scan.range_max)
        self.assertEqual(list(scan.intensities), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0])

    def test_a_scan_of_another_shape_passes_without_proximity(self):
        robot = self.join(3)
        scans = Recorder("/hero_3/laser", rospy.AnyMsg)
        proximity = Recorder("/hero_3/proximity", LaserScan)
        odd = stock_messages.to_bytes(LaserScan(ranges=[0.1] * 5))
        good = stock_messages.make_laser("hero_3", rospy.Time.now(), [0.1] * 8)
        for payload in (odd, b"\x01\x02", good):
            robot.send("laser", payload)
        proximity.wait_count(1)
        self.assertIn(odd, [message._buff for message in scans.messages])
        self.assertEqual(len(proximity.messages), 1)
        self.fleet.wait("/hero_3", Robot.READY, "counted", lambda e: e.dropped_messages >= 1)

    # Odometry.

    def test_odom_raw_passes_byte_for_byte(self):
        robot = self.join(4)
        raw = Recorder("/hero_4/odom_raw", rospy.AnyMsg)
        payloads = [stock_messages.make_odom("hero_4", rospy.Time(2, index), 0.5) for index in range(3)]
        for payload in payloads:
            robot.send("odom", payload)
        self.assertEqual([message._buff for message in raw.wait_count(3)], payloads)

    def test_odom_follows_the_ticks_and_not_the_robots_own_estimate(self):
        robot = self.join(5)
        messages = self.drive(robot, [(5.0 * step, 5.0 * step) for step in range(31)])
        self.assert_pose(messages[-1], 150 * TICK_M, 0.0, 0.0)
        self.assertAlmostEqual(messages[-1].twist.twist.linear.x, 5 * TICK_M / STEP_S, 3)
        self.assertEqual(messages[-1].twist.twist.linear.y, 0.0)
        header = messages[-1].header
        self.assertEqual((header.frame_id, messages[-1].child_frame_id), ("hero_5/odom", "hero_5/base_link"))

    def test_odom_follows_exact_arcs(self):
        robot = self.join(6)
        messages = self.drive(robot, [(0.0, 0.0), (100.0, 300.0), (300.0, 300.0)])
        turn_rad = 200 * TICK_M / WHEEL_SEPARATION_M
        radius_m = 200 * TICK_M / turn_rad
        self.assert_pose(messages[1], radius_m * math.sin(turn_rad), radius_m * (1 - math.cos(turn_rad)), turn_rad)
        # Left and right have the same total, so it heads where it began; the path was an S.
        self.assertAlmostEqual(read_pose(messages[2])[2], 0.0, 9)

    def test_odom_carries_covariances(self):
        robot = self.join(7)
        message = self.drive(robot, [(0.0, 0.0)])[0]
        for covariance in (message.pose.covariance, message.twist.covariance):
            self.assertTrue(all(covariance[index * 7] > 0.0 for index in range(6)))
            self.assertEqual(sum(value != 0.0 for value in covariance), 6)

    def test_the_odom_transform_agrees_with_odom(self):
        robot = self.join(8)
        transforms = Recorder("/tf", TFMessage)
        messages = self.drive(robot, [(7.0 * step, 9.0 * step) for step in range(10)])

        def list_own():
            return [
                transform
                for message in list(transforms.messages)
                for transform in message.transforms
                if transform.child_frame_id == "hero_8/base_link"
            ]

        wait_for(lambda: len(list_own()) == 10, "ten transforms")
        for transform, message in nonempty(zip(list_own(), messages)):
            self.assertEqual(transform.header.frame_id, "hero_8/odom")
            self.assertEqual(transform.header.stamp, message.header.stamp)
            self.assertEqual(transform.transform.rotation, message.pose.pose.orientation)
            self.assertEqual(transform.transform.translation.x, message.pose.pose.position.x)
            self.assertEqual(transform.transform.translation.y, message.pose.pose.position.y)

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

    def test_a_refused_set_odom_changes_nothing(self):
        robot = self.join(10)
        odoms = Recorder("/hero_10/odom", Odometry)
        self.drive(robot, [(0.0, 0.0), (20.0, 20.0)], odoms=odoms)
        robot.answers["set_odom"] = lambda _: b"\x00\x00\x00\x00\x00"
        rospy.wait_for_service("/hero_10/set_odom", 60.0)
        self.assertFalse(rospy.ServiceProxy("/hero_10/set_odom", SetOdom)(5.0, 5.0, 0.0).success)
        self.assert_pose(self.drive(robot, [(20.0, 20.0)], odoms=odoms)[0], 20 * TICK_M, 0.0, 0.0)

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

    def test_a_reboot_whose_boot_line_was_lost_leaves_the_pose_where_it_was(self):
        robot = self.join(26)
        odoms = Recorder("/hero_26/odom", Odometry)
        self.drive(robot, [(20.0 * step, 20.0 * step) for step in range(11)], odoms=odoms)
        robot.close()
        self.fleet.wait("/hero_26", Robot.AWAY)
        rebooted = self.join(26)
        # Before its first time answer a robot that has just started stamps with its uptime.
        messages = self.drive(rebooted, [(0.0, 0.0), (1.0, 1.0)], start=rospy.Time(2, 10000000), odoms=odoms)
        self.assert_pose(messages[0], 200 * TICK_M, 0.0, 0.0)
        messages = self.drive(rebooted, [(2.0, 2.0)], odoms=odoms)
        self.assert_pose(messages[0], 202 * TICK_M, 0.0, 0.0)

    def test_a_set_odom_that_is_answered_too_late_still_counts(self):
        robot = self.join(27)
        odoms = Recorder("/hero_27/odom", Odometry)
        self.drive(robot, [(0.0, 0.0), (50.0, 50.0)], odoms=odoms)
        robot.answers["set_odom"] = lambda _: None
        rospy.wait_for_service("/hero_27/set_odom", 60.0)
        with self.assertRaisesRegex(rospy.ServiceException, "was not answered within"):
            rospy.ServiceProxy("/hero_27/set_odom", SetOdom)(3.0, 4.0, 0.0)
        robot.answer("set_odom", encode_answer(True, "late"))
        self.assert_pose(self.drive(robot, [(10.0, 10.0)], odoms=odoms)[0], 3.0 + 10 * TICK_M, 4.0, 0.0)

    def test_a_reconnect_without_a_reboot_keeps_the_ticks(self):
        robot = self.join(12)
        odoms = Recorder("/hero_12/odom", Odometry)
        self.drive(robot, [(0.0, 0.0), (50.0, 50.0)], odoms=odoms)
        robot.close()
        self.fleet.wait("/hero_12", Robot.AWAY)
        returned = self.join(12)
        messages = self.drive(returned, [(60.0, 60.0)], odoms=odoms)
        self.assert_pose(messages[0], 60 * TICK_M, 0.0, 0.0)

    def test_a_heartbeat_that_tells_of_a_reboot_is_reported(self):
        robot = self.join(13)
        robot.log(heartbeat_line("hero_13", 500.0))
        robot.log(heartbeat_line("hero_13", 1.5))
        self.wait_log("hero_13 rebooted 1.5 s ago")
        self.fleet.wait("/hero_13", Robot.READY, "young", lambda e: 1.0 < e.uptime.to_sec() < 100.0)

    def test_ticks_that_no_wheel_can_have_run_do_not_move_the_robot(self):
        robot = self.join(14)
        readings = [(0.0, 0.0), (10.0, 10.0), (1e9, -1e9), (math.nan, 5.0), (20.0, 20.0), (30.0, 30.0)]
        for message in nonempty(self.drive(robot, readings)):
            x_m, y_m, yaw_rad = read_pose(message)
            self.assertLessEqual(abs(x_m), 31 * TICK_M)
            self.assertEqual((y_m, yaw_rad), (0.0, 0.0))
            self.assertTrue(math.isfinite(message.twist.twist.linear.x))

    def test_a_robot_without_an_encoder_gets_its_own_odometry_published(self):
        robot = self.join(15, declarations=[e for e in STOCK_DECLARATIONS if "encoder" not in e.name])
        odoms = Recorder("/hero_15/odom", Odometry)
        robot.send("odom", stock_messages.make_odom("hero_15", rospy.Time.now(), 0.7, 0.1, 0.2))
        message = odoms.wait_count(1)[0]
        self.assert_pose(message, 0.7, 0.1, 0.2)
        self.assertGreater(message.pose.covariance[0], 0.0)

    def test_odometry_is_not_held_back_when_encoder_readings_stay_away(self):
        robot = self.join(16)
        odoms = Recorder("/hero_16/odom", Odometry)
        self.drive(robot, [(0.0, 0.0), (10.0, 10.0)], odoms=odoms)
        for _ in range(5):
            robot.send("odom", stock_messages.make_odom("hero_16", rospy.Time.now()))
        odoms.wait_count(2 + 4)
        self.assert_pose(odoms.messages[-1], 10 * TICK_M, 0.0, 0.0)

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

    def test_a_good_stamp_is_the_robots_own(self):
        robot = self.join(18)
        odoms = Recorder("/hero_18/odom", Odometry)
        stamp = rospy.Time.now() - rospy.Duration(0.8)
        self.assertEqual(self.drive(robot, [(0.0, 0.0)], start=stamp, odoms=odoms)[0].header.stamp, stamp)

    def test_stamps_never_go_backwards_on_a_topic(self):
        robot = self.join(19)
        start = rospy.Time.now() - rospy.Duration(2.0)
        odoms = Recorder("/hero_19/odom", Odometry)
        encoders = Recorder("/hero_19/encoder", Encoder)
        imus = Recorder("/hero_19/imu", Imu)
        transforms = Recorder("/tf", TFMessage)
        for offset_s in (0.0, 1.0, 0.3, 0.4, 1.0, 1.1):
            stamp = start + rospy.Duration(offset_s)
            send_burst(robot, 0.0, 0.0, stamp)
            robot.send("imu", stock_messages.make_imu("hero_19", stamp))
        for recorder in (odoms, encoders, imus):
            stamps = [message.header.stamp for message in recorder.wait_count(6)]
            self.assertEqual(stamps, sorted(set(stamps)))

        def list_stamps():
            by_child = {}
            for message in list(transforms.messages):
                for transform in message.transforms:
                    if transform.child_frame_id.startswith("hero_19/"):
                        by_child.setdefault(transform.child_frame_id, []).append(transform.header.stamp)
            return by_child

        wait_for(lambda: sum(map(len, list_stamps().values())) == 30, lambda: "30 of %s" % list_stamps())
        for child, stamps in nonempty(list_stamps().items()):
            self.assertEqual(stamps, sorted(set(stamps)), child)

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

    def test_messages_that_are_cut_short_are_counted_and_nothing_else_suffers(self):
        robot = self.join(25)
        odoms = Recorder("/hero_25/odom", Odometry)
        # Messages that nobody wants are not looked at, so all are wanted here.
        for topic in ("/hero_25/imu", "/hero_25/encoder", "/hero_25/laser", "/hero_25/proximity", "/tf"):
            Recorder(topic, rospy.AnyMsg)
        for name in ("odom", "encoder", "imu", "/tf", "laser"):
            for payload in (b"", b"\x01", bytes(15), b"\xff" * 40):
                robot.send(name, payload)
        self.fleet.wait("/hero_25", Robot.READY, "counted", lambda e: e.dropped_messages >= 16)
        self.drive(robot, [(0.0, 0.0)], odoms=odoms)

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
