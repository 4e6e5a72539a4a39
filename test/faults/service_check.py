"""Checks that a driver still serves a robot that a fault must not affect."""

import struct

import rospy
from std_msgs.msg import ColorRGBA

from hero_driver.rosserial import packets
from hero_msgs.msg import Encoder
from hero_test.driver_case import Recorder, make_publisher, wait_packets, wait_payloads
from hero_test.fake_robot import TIME_PACKET
from hero_test.stock_messages import make_encoder


class ServiceCheck:
    """Messages, commands and time requests of one robot, checked on demand."""

    def __init__(self, driver, robot):
        """Return when the robot's topics are connected in both directions."""
        self._driver = driver
        self._robot = robot
        driver.fleet.wait_ready(robot.namespace)
        self._encoders = Recorder(robot.namespace + "/encoder", Encoder)
        self._light = make_publisher(robot.namespace + "/led", ColorRGBA)

    def verify(self, count=1):
        """Pass count messages in each direction, and let the robot ask for the time."""
        robot = self._robot
        messages, lights = len(self._encoders.messages), len(robot.payloads_on("led"))
        asked = len(robot.payloads_with_id(packets.ID_TIME))
        for number in range(count):
            robot.send("encoder", make_encoder(robot.name, rospy.Time.now(), float(number), 0.0))
            self._light.publish(ColorRGBA(float(number), 0.0, 0.0, 0.0))
        ticks = [message.left_ticks for message in self._encoders.wait_count(messages + count)[messages:]]
        wait_payloads(robot, "led", lights + count)
        colors = [struct.unpack("<f", payload[:4])[0] for payload in robot.payloads_on("led")[lights:]]
        assert ticks == colors == [float(number) for number in range(count)]
        robot.send_bytes(TIME_PACKET)
        wait_packets(robot, packets.ID_TIME, asked + 1)
        assert robot.is_connected and self._driver.process.poll() is None
        return True
