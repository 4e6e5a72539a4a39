#!/usr/bin/env python3
"""The fake robot itself: it tunes, drops and stops as the stock firmware does, seen from a server's socket."""

import socket
import struct
import unittest

import rostest

from hero_driver.rosserial import packets, payloads
from hero_test.fake_robot import FakeRobot
from hero_test.waiting import TIMEOUT_S, wait_for

NEUTRAL = packets.encode_packet(104, struct.pack("<2h", 1500, 1500))
LED = packets.encode_packet(100, bytes(16))
POSITION_ID, VELOCITY_ID = 106, 109
TUNE_POSITION_ID, TUNE_VELOCITY_ID = 108, 111


def make_twist(topic_id, linear_m_s=0.0):
    return packets.encode_packet(topic_id, struct.pack("<6d", linear_m_s, 0, 0, 0, 0, 0))


class TestFakeRobot(unittest.TestCase):
    def setUp(self):
        with socket.create_server(("127.0.0.1", 0)) as listener:
            self.robot = FakeRobot(1, has_motors=True).connect(listener.getsockname())
            self.server, _ = listener.accept()
        self.addCleanup(self.server.close)
        self.addCleanup(self.robot.close)
        self.server.settimeout(TIMEOUT_S)
        self.reader = packets.PacketReader()
        self.requests = 0
        self.send(b"")

    def wait_packet(self, topic_id, condition=lambda payload: True):
        """Return the next payload under an id that condition() likes."""

        def read():
            found = [
                packet.payload
                for packet in self.reader.receive_bytes(self.server.recv(65536))
                if packet.topic_id == topic_id and condition(packet.payload)
            ]
            return found[:1]

        return wait_for(read, "packet %d" % topic_id)[0]

    def wait_ticks(self, condition=lambda ticks: True):
        return read_ticks(self.wait_packet(128, lambda payload: condition(read_ticks(payload))))

    def send(self, data):
        """Send data in one piece and wait until the robot has handled it."""
        self.requests += 1
        self.server.sendall(data + packets.encode_packet(packets.ID_PUBLISHER, b""))
        wait_for(lambda: self.robot.requests == self.requests, "the robot to read")

    def test_wheels_turn_while_the_last_accepted_command_is_motion(self):
        first = self.wait_ticks()
        self.assertEqual(self.wait_ticks(), first)
        self.send(make_twist(VELOCITY_ID, 0.1))
        self.wait_ticks(lambda ticks: ticks > first + 20)
        self.send(LED * 51 + make_twist(POSITION_ID))
        self.assertTrue(self.robot.motors.is_turning)
        self.send(LED * 51 + make_twist(VELOCITY_ID))
        self.assertFalse(self.robot.motors.is_turning)

    def test_a_zero_behind_a_motion_is_dropped_but_not_a_motion_behind_a_zero(self):
        self.send(make_twist(VELOCITY_ID) + make_twist(VELOCITY_ID, 0.1) + make_twist(VELOCITY_ID))
        self.assertTrue(self.robot.motors.is_turning)
        self.assertEqual([velocity.linear_m_s for velocity in self.robot.velocities], [0.0, 0.1, 0.0])

    def test_only_a_zero_behind_50_ms_of_packets_in_one_send_ends_self_tuning(self):
        for tune_id, answer_id, topic_id in (
            (TUNE_VELOCITY_ID, 136, VELOCITY_ID),
            (TUNE_POSITION_ID, 134, POSITION_ID),
        ):
            self.server.sendall(packets.encode_packet(tune_id, b""))
            self.assertEqual(self.wait_packet(answer_id), b"\0\x0f\0\0\0PID Autotuning!")
            self.wait_packet(packets.ID_LOG, lambda p: "Tunning" in payloads.decode_log(p).text)
            for count in (0, 60, 178):  # too short, too short, longer than the receive window
                self.send(NEUTRAL * count + make_twist(topic_id))
                self.assertTrue(self.robot.motors.is_turning)
            self.send(NEUTRAL * 110 + make_twist(topic_id))
            self.assertFalse(self.robot.motors.is_turning)

    def test_a_robot_that_is_pushed_counts_ticks(self):
        first = self.wait_ticks()
        self.robot.motors.is_pushed = True
        self.wait_ticks(lambda ticks: ticks > first + 20)


def read_ticks(payload):
    return struct.unpack("<d", payload[-88:-80])[0]


if __name__ == "__main__":
    rostest.rosrun("hero_driver", "fake_robot", TestFakeRobot)
