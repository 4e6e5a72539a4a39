#!/usr/bin/env python3
"""Rosserial devices that are no HeRos, with ~namespace_policy any."""

import struct

import rospy
import rostest
import stock_messages
from driver_case import OwnDriverCase, Recorder, ask_parameter, list_publishers, make_publisher, wait_packets
from fake_robot import (
    ANSWER_MD5,
    CLIENT_ANSWERS,
    CLIENT_REQUESTS,
    PUB,
    STOCK_DECLARATIONS,
    SUB,
    Declaration,
)
from geometry_msgs.msg import Twist
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Bool, Int32, String
from std_srvs.srv import SetBool, SetBoolRequest, Trigger, TriggerResponse
from text_messages import STRING_MD5, TRIGGER_REQUEST_MD5, WRONG_MD5, make_text
from tf2_msgs.msg import TFMessage

from hero_msgs.msg import RobotArray
from hero_test.waiting import wait_for


class TestDriverDevices(OwnDriverCase):
    """Devices that are no HeRos, with ~namespace_policy any."""

    def test_a_generic_device_can_do_all_that_rosserial_offers(self):
        rospy.Service("/add_dots", Trigger, lambda _: TriggerResponse(True, "..."))
        rospy.set_param("/limit", 12)
        rospy.set_param("/hidden/list", ["x", "y"])
        device = [
            Declaration(PUB, 125, "chatter", "std_msgs/String", STRING_MD5),
            Declaration(SUB, 100, "/numbers", "std_msgs/Int32", Int32._md5sum, 512),
            Declaration(SUB, 101, "/cmd_vel", "geometry_msgs/Twist", Twist._md5sum),
            Declaration(2, 126, "/blink", "std_srvs/Trigger", ANSWER_MD5),
            Declaration(3, 102, "/blink", "std_srvs/Trigger", TRIGGER_REQUEST_MD5),
            Declaration(CLIENT_REQUESTS, 127, "/add_dots", "std_srvs/Trigger", TRIGGER_REQUEST_MD5),
            Declaration(CLIENT_ANSWERS, 103, "/add_dots", "std_srvs/Trigger", ANSWER_MD5),
        ]
        driver = self.start(namespace_policy="any")
        robot = self.dial(driver, ready=False, declarations=device)
        wait_for(lambda: driver.fleet.newest.robots, "the device in the report")
        self.assertEqual(driver.fleet.newest.robots[0].id, -1)
        texts = Recorder("/chatter", String)
        robot.send_packet(125, make_text("hello"))
        self.assertEqual(texts.wait_count(1)[0].data, "hello")
        numbers = make_publisher("/numbers", Int32)
        for number in range(30):
            numbers.publish(Int32(number))
        self.assertEqual(wait_packets(robot, 100, 30), [struct.pack("<i", number) for number in range(30)])
        # A foreign robot's cmd_vel has no gate of 50 ms: what is published is sent, in order, all of it.
        drive = make_publisher("/cmd_vel", Twist)
        sent = [stock_messages.make_twist(0.1 * index, 0.0) for index in range(1, 11)]
        for payload in sent:
            drive.publish(stock_messages.from_bytes(Twist, payload))
        self.assertEqual(wait_packets(robot, 101, 10), sent)
        rospy.wait_for_service("/blink", 60.0)
        answer = rospy.ServiceProxy("/blink", Trigger)()
        self.assertEqual((answer.success, answer.message), (True, "/blink"))
        self.assertEqual(robot.payloads_with_id(102), [b""])
        robot.send_packet(127, b"")
        self.assertEqual(wait_packets(robot, 103), [stock_messages.to_bytes(TriggerResponse(True, "..."))])
        self.assertEqual(ask_parameter(robot, "/limit"), ([12], [], []))
        self.assertEqual(ask_parameter(robot, "/hidden/list"), ([], [], ["x", "y"]))

    def test_transforms_of_devices_and_of_heros_pass_whole(self):
        driver = self.share(namespace_policy="any")
        tf_declaration = STOCK_DECLARATIONS[4]
        device = self.dial(driver, 50, ready=False, declarations=[tf_declaration])
        hero = self.dial(driver, 10)
        transforms = Recorder("/tf", TFMessage)
        stamp = rospy.Time.now()
        device.send_packet(tf_declaration.topic_id, stock_messages.make_transform("map", "crane", stamp, 1.5))
        stock_messages.send_burst(hero, 0.0, 0.0, stamp)

        def list_frames():
            return {
                (t.header.frame_id, t.child_frame_id) for m in list(transforms.messages) for t in m.transforms
            }

        wait_for(lambda: len(list_frames()) == 6, lambda: "six transforms, got %s" % list_frames())
        self.assertIn(("map", "crane"), list_frames())
        self.assertIn(("hero_10/base_link", "hero_10/hat_link"), list_frames())

    def test_a_hero_among_devices_is_a_hero(self):
        driver = self.share(namespace_policy="any")
        extra = [Declaration(PUB, 140, "/gossip", "std_msgs/String", STRING_MD5)]
        robot = self.dial(driver, 9, declarations=[*STOCK_DECLARATIONS, *extra])
        texts = Recorder("/gossip", String)
        robot.send_packet(140, make_text("free"))
        texts.wait_count(1)
        Recorder("/hero_9/proximity", rospy.AnyMsg)
        drive = make_publisher("/hero_9/velocity_controller/cmd_vel", Twist)
        drive.publish(stock_messages.from_bytes(Twist, stock_messages.make_twist(0.1, 0.0)))
        drive.publish(Twist())
        wait_for(lambda: [v.is_zero for v in robot.velocities[-2:]] == [True, True], "the stop, twice")

    def test_two_devices_of_one_address_do_not_push_each_other_out(self):
        driver = self.share(namespace_policy="any")
        devices = []
        for name in ("left", "right"):
            declarations = [Declaration(PUB, 125, "/" + name, "std_msgs/String", STRING_MD5)]
            devices.append(self.dial(driver, ready=False, declarations=declarations))
        for device, name in zip(devices, ("left", "right")):
            texts = Recorder("/" + name, String)
            device.send_packet(125, make_text(name))
            self.assertEqual(texts.wait_count(1)[0].data, name)
            self.assertTrue(device.is_connected)

    def test_a_device_with_a_wrong_md5_gets_one_clear_error(self):
        driver = self.share(namespace_policy="any")
        declarations = [
            Declaration(PUB, 125, "/wrong", "std_msgs/String", WRONG_MD5),
            Declaration(PUB, 126, "/right", "std_msgs/String", STRING_MD5),
        ]
        robot = self.dial(driver, ready=False, declarations=declarations)
        line = driver.wait_line("topic /wrong refused")
        self.assertIn(WRONG_MD5, line)
        self.assertIn(STRING_MD5, line)
        texts = Recorder("/right", String)
        robot.send_packet(126, make_text("still here"))
        texts.wait_count(1)

    def test_a_device_can_neither_call_nor_publish_nor_serve_driver_names(self):
        driver = self.start(namespace_policy="any")
        own = driver.node
        device = [
            Declaration(PUB, 125, "/chatter", "std_msgs/String", STRING_MD5),
            Declaration(CLIENT_REQUESTS, 126, own + "/stop", "std_srvs/SetBool", SetBoolRequest._md5sum),
            Declaration(CLIENT_ANSWERS, 100, own + "/stop", "std_srvs/SetBool", ANSWER_MD5),
            Declaration(PUB, 127, own + "/stop_request", "std_msgs/Bool", Bool._md5sum),
            Declaration(2, 128, "/other/stop", "std_srvs/Trigger", ANSWER_MD5),
            Declaration(3, 101, "/other/stop", "std_srvs/Trigger", TRIGGER_REQUEST_MD5),
            Declaration(PUB, 129, "/fleet", "hero_common/RobotArray", RobotArray._md5sum),
            Declaration(PUB, 130, "/clock", "rosgraph_msgs/Clock", Clock._md5sum),
        ]
        refused = [entry for entry in device if entry.name != "/chatter"]
        rospy.wait_for_service(own + "/stop", 60.0)
        rospy.ServiceProxy(own + "/stop", SetBool)(True)
        robot = self.dial(driver, ready=False, declarations=device)
        for entry in refused:
            driver.wait_line("topic '%s' refused: only drivers and ROS itself" % entry.name)
        for name in {entry.name for entry in refused}:
            self.assertEqual(len(driver.find_lines("topic '%s' refused" % name)), 1, name)
        robot.send_packet(126, b"\x00")
        robot.send_packet(127, b"\x00")
        texts = Recorder("/chatter", String)
        robot.send_packet(125, make_text("still here"))
        texts.wait_count(1)
        sent = rospy.Time.now()
        wait_for(lambda: driver.fleet.newest.header.stamp > sent, "a report of after that")
        self.assertTrue(driver.fleet.newest.stopped)
        self.assertEqual(list_publishers("/fleet") + list_publishers("/clock"), [])

    def test_a_device_reads_parameters_below_its_own_name_and_of_others(self):
        rospy.set_param("/limit", 12)
        rospy.set_param("/arm_3/limit", 13)
        driver = self.share(namespace_policy="any")
        device = [Declaration(PUB, 125, "/arm_3/state", "std_msgs/String", STRING_MD5)]
        robot = self.dial(driver, declarations=device, ready=False)
        driver.fleet.wait_ready("/arm_3")
        self.assertEqual(ask_parameter(robot, "limit"), ([13], [], []))
        self.assertEqual(ask_parameter(robot, "/limit"), ([12], [], []))


if __name__ == "__main__":
    rospy.init_node("test_driver_devices")
    rostest.rosrun("hero_driver", "driver_devices", TestDriverDevices)
