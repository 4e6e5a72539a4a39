#!/usr/bin/env python3
"""Topics of stock robots through the driver, both ways, and the handshakes that robots get wrong."""

import re
import struct
from pathlib import Path

import rosgraph
import rospy
import rosservice
import rostest
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Log as RosLog
from sensor_msgs.msg import Imu
from std_msgs.msg import Bool, ColorRGBA

from hero_driver.rosserial import packets, payloads
from hero_msgs.msg import Encoder, Motor
from hero_test import stock_messages
from hero_test.driver_case import (
    DriverCase,
    Recorder,
    list_driver_topics,
    make_publisher,
    wait_packets,
    wait_payloads,
)
from hero_test.fake_robot import STOCK_DECLARATIONS, SUB, TIME_PACKET, heartbeat_line
from hero_test.nonempty import nonempty
from hero_test.waiting import wait_for

PAGE = Path(__file__).resolve().parents[3] / "docs" / "robot_interface.md"

PUBLISHED = {
    "laser": "sensor_msgs/LaserScan",
    "proximity": "sensor_msgs/LaserScan",
    "imu": "sensor_msgs/Imu",
    "encoder": "hero_msgs/Encoder",
    "odom": "nav_msgs/Odometry",
    "odom_raw": "nav_msgs/Odometry",
}
OF_HERO_PLUS = {"distance": "std_msgs/Float32", "range": "sensor_msgs/Range"}
SUBSCRIBED = {
    "led": "std_msgs/ColorRGBA",
    "laser_enable": "std_msgs/Bool",
    "cmd_motor": "hero_msgs/Motor",
    "position_controller/cmd_vel": "geometry_msgs/Twist",
    "cmd_vel": "geometry_msgs/Twist",
    "velocity_controller/cmd_vel": "geometry_msgs/Twist",
}
SERVICES = {
    "ir_calibration": "hero_msgs/SetIRCalibration",
    "set_odom": "hero_msgs/SetOdom",
    "motors_parameters": "hero_msgs/SetMotor",
    "position_controller/pid_parameters": "hero_msgs/SetPID",
    "position_controller/pid_calibration": "std_srvs/Trigger",
    "velocity_controller/pid_parameters": "hero_msgs/SetPID",
    "velocity_controller/pid_calibration": "std_srvs/Trigger",
}


class TestDriverTopics(DriverCase):
    def wait_topics(self, namespace):
        expected = sorted("%s/%s" % (namespace, name) for name in {**PUBLISHED, **SUBSCRIBED, **SERVICES})
        wait_for(
            lambda: list_driver_topics(namespace) == expected,
            lambda: "%s, there are %s" % (expected, list_driver_topics(namespace)),
        )

    def test_every_stock_topic_and_service_appears_with_its_type(self):
        self.join(1)
        self.wait_topics("/hero_1")
        types = dict(rosgraph.Master("/test").getTopicTypes())
        for name, ros_type in {**PUBLISHED, **SUBSCRIBED}.items():
            self.assertEqual(types["/hero_1/" + name], ros_type)
        self.assertEqual(types["/tf"], "tf2_msgs/TFMessage")
        for name, ros_type in SERVICES.items():
            self.assertEqual(rosservice.get_service_type("/hero_1/" + name), ros_type)

    def test_the_documents_list_these_topics_and_services_and_no_others(self):
        listed = {}
        for line in PAGE.read_text(encoding="utf-8").splitlines():
            if line.startswith("| `/hero_N/"):
                names, ros_type = line.split("|")[1:3]
                listed.update(dict.fromkeys(re.findall("`/hero_N/([a-z_/]+)`", names), ros_type.strip()))
        self.assertEqual(listed, {**PUBLISHED, **OF_HERO_PLUS, **SUBSCRIBED, **SERVICES})

    def test_what_a_robot_publishes_arrives_with_its_content(self):
        robot = self.join(2)
        encoders, imus = Recorder("/hero_2/encoder", Encoder), Recorder("/hero_2/imu", Imu)
        stamp = rospy.Time.now()
        robot.send("encoder", stock_messages.make_encoder("hero_2", stamp, 5.0, -7.0))
        robot.send("imu", stock_messages.make_imu("hero_2", stamp))
        encoder, imu = encoders.wait_count(1)[0], imus.wait_count(1)[0]
        self.assertEqual((encoder.left_ticks, encoder.right_ticks), (5.0, -7.0))
        self.assertEqual((encoder.header.frame_id, encoder.header.stamp), ("hero_2/encoder", stamp))
        self.assertEqual(
            imu.orientation.z,
            stock_messages.from_bytes(Imu, stock_messages.make_imu("", stamp)).orientation.z,
        )

    def test_commands_reach_the_robot_byte_for_byte_under_the_ids_it_declared(self):
        robot = self.join(3)
        for name, message in (
            ("led", ColorRGBA(0.25, 0.5, 0.75, 1.0)),
            ("laser_enable", Bool(True)),
            ("cmd_motor", Motor(1400, 1600)),
            ("velocity_controller/cmd_vel", Twist()),
            ("position_controller/cmd_vel", Twist()),
        ):
            message_bytes = stock_messages.to_bytes(message)
            make_publisher("/hero_3/" + name, type(message)).publish(message)
            self.assertEqual(wait_payloads(robot, name), [message_bytes])

    def test_programs_that_were_there_before_the_robot_are_served(self):
        encoders = Recorder("/hero_15/encoder", Encoder, connected=False)
        light = rospy.Publisher("/hero_15/led", ColorRGBA, queue_size=1, latch=True)
        light.publish(ColorRGBA(1.0, 0.0, 0.0, 0.0))
        robot = self.join(15)
        encoders.wait_connected()
        robot.send("encoder", stock_messages.make_encoder("hero_15", rospy.Time.now(), 1.0, 1.0))
        encoders.wait_count(1)
        wait_payloads(robot, "led")

    def test_two_robots_do_not_mix(self):
        first, second = self.join(4), self.join(5)
        odoms = {robot: Recorder(robot.namespace + "/odom_raw", Odometry) for robot in (first, second)}
        for index, robot in enumerate((first, second, first, second, first)):
            robot.send("odom", stock_messages.make_odom(robot.name, rospy.Time.now(), float(index)))
        self.assertEqual([m.pose.pose.position.x for m in odoms[first].wait_count(3)], [0.0, 2.0, 4.0])
        self.assertEqual([m.pose.pose.position.x for m in odoms[second].wait_count(2)], [1.0, 3.0])
        lights = {robot: make_publisher(robot.namespace + "/led", ColorRGBA) for robot in (first, second)}
        for index in range(10):
            lights[first].publish(ColorRGBA(1.0, float(index), 0.0, 0.0))
            lights[second].publish(ColorRGBA(2.0, float(index), 0.0, 0.0))
        for red, robot in ((1.0, first), (2.0, second)):
            colors = [struct.unpack("<4f", payload)[:2] for payload in wait_payloads(robot, "led", 10)]
            self.assertEqual(colors, [(red, float(index)) for index in range(10)])

    def test_a_robot_that_returns_with_other_ids_gets_only_those(self):
        robot = self.join(6)
        light = make_publisher("/hero_6/led", ColorRGBA)
        light.publish(ColorRGBA(1.0, 0.0, 0.0, 0.0))
        wait_packets(robot, 100)
        robot.close()
        self.fleet.wait("/hero_6", 2)
        # An older firmware: without laser_enable and with its slots in another order.
        older = [
            entry._replace(topic_id=entry.topic_id + 7) if entry.kind == SUB else entry
            for entry in STOCK_DECLARATIONS
            if "laser_enable" not in entry.name
        ]
        returned = self.join(6, declarations=older)
        light.publish(ColorRGBA(2.0, 0.0, 0.0, 0.0))
        wait_packets(returned, 107)
        switch = make_publisher("/hero_6/laser_enable", Bool)
        switch.publish(Bool(True))
        light.publish(ColorRGBA(3.0, 0.0, 0.0, 0.0))
        wait_packets(returned, 107, 2)
        declared = {entry.topic_id for entry in older} | {packets.ID_PUBLISHER, packets.ID_TIME}
        self.assertEqual({packet.topic_id for packet in returned.received} - declared, set())

    def test_each_time_request_is_answered_with_ros_time(self):
        robot = self.join(8)
        before = len(robot.payloads_with_id(packets.ID_TIME))
        earliest = rospy.Time.now()
        for count in range(1, 4):
            robot.send_bytes(TIME_PACKET)
            wait_packets(robot, packets.ID_TIME, before + count)
        times = [payloads.decode_time(payload) for payload in robot.payloads_with_id(packets.ID_TIME)[before:]]
        for secs, nsecs in nonempty(times):
            self.assertLessEqual(earliest.to_nsec(), secs * 10**9 + nsecs)
            self.assertLessEqual(secs * 10**9 + nsecs, rospy.Time.now().to_nsec())

    def test_log_lines_reach_rosout_with_level_and_name_and_without_colors(self):
        robot = self.join(12)
        robot.log("\x1b[91m[hero_12] IMU hat detected!\x1b[0m", payloads.LOG_WARN)
        robot.log("Reseting PID...\n[FATAL] forged\x07line", payloads.LOG_INFO)
        robot.log("the end", payloads.LOG_ERROR)
        self.assertEqual(self.wait_log("the end").level, RosLog.ERROR)
        lines = {line.msg: line.level for line in self.find_logs("^hero_12: ")}
        self.assertEqual(lines["hero_12: IMU hat detected!"], RosLog.WARN)
        self.assertEqual(lines["hero_12: Reseting PID... [FATAL] forged line"], RosLog.INFO)
        self.assertFalse([text for text in lines if "\x1b" in text or "\n" in text or "\x07" in text])

    def test_the_heartbeat_is_read_but_not_logged(self):
        robot = self.join(13)
        robot.log(heartbeat_line("hero_13", 421.5))
        robot.log("after the heartbeat")
        self.wait_log("after the heartbeat")
        self.assertEqual([line.msg for line in self.find_logs("onected at time") if line.level > RosLog.DEBUG], [])
        self.fleet.wait("/hero_13", 1, "with uptime", lambda entry: 421 <= entry.uptime.to_sec() < 500)


if __name__ == "__main__":
    rospy.init_node("test_driver_topics")
    rostest.rosrun("hero_driver", "driver_topics", TestDriverTopics)
