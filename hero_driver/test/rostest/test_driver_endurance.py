#!/usr/bin/env python3
"""What others do to the driver: a master that does not answer, readers that do not read, services that hang."""

import contextlib
import os
import subprocess

import rosgraph
import rospy
import rostest
from std_msgs.msg import ColorRGBA

from hero_driver.rosserial import packets
from hero_msgs.msg import Encoder, Robot
from hero_test import stock_messages
from hero_test.driver_case import (
    OwnDriverCase,
    Recorder,
    has_connection,
    list_driver_topics,
    make_publisher,
    wait_packets,
    wait_payloads,
)
from hero_test.fake_robot import (
    TIME_PACKET,
)
from hero_test.nonempty import nonempty
from hero_test.processes import suspended
from hero_test.waiting import wait_for

TRIGGER_REQUEST_MD5 = "d41d8cd98f00b204e9800998ecf8427e"


def count_resources(pid):
    """Return how many sockets and threads a process has; rospy's other files go when Python collects garbage."""
    kinds = []
    for entry in os.scandir("/proc/%d/fd" % pid):
        with contextlib.suppress(FileNotFoundError):
            kinds.append(os.readlink(entry.path))
    return sum(kind.startswith("socket:") for kind in kinds), len(os.listdir("/proc/%d/task" % pid))


class TestDriverEndurance(OwnDriverCase):
    def assert_time_is_answered(self, robot):
        count = len(robot.payloads_with_id(packets.ID_TIME))
        robot.send_bytes(TIME_PACKET)
        wait_packets(robot, packets.ID_TIME, count + 1)

    def send_encoder(self, robot, ticks):
        robot.send("encoder", stock_messages.make_encoder(robot.name, rospy.Time.now(), ticks, ticks))

    def test_a_hanging_master_affects_no_connected_program(self):
        driver = self.start()
        robot = self.dial(driver, 1)
        encoders = Recorder("/hero_1/encoder", Encoder)
        light = make_publisher("/hero_1/led", ColorRGBA)
        with suspended(rosgraph.Master("/test").getPid()):
            newcomer = self.dial(driver, 2, ready=False)
            wait_for(lambda: newcomer.requests, "a request for the newcomer's topics")
            for count in range(1, 4):
                self.send_encoder(robot, float(count))
                self.send_encoder(newcomer, float(count))
                encoders.wait_count(count)
                light.publish(ColorRGBA(float(count), 0.0, 0.0, 0.0))
                wait_payloads(robot, "led", count)
                for each in (robot, newcomer):
                    self.assert_time_is_answered(each)
            driver.fleet.wait("/hero_2", Robot.READY)
        late = Recorder("/hero_2/encoder", Encoder)
        self.send_encoder(newcomer, 9.0)
        self.assertEqual(late.wait_count(1)[0].left_ticks, 9.0)

    def test_a_subscriber_that_does_not_read_delays_no_other(self):
        driver = self.start(max_packets_per_s=1000000, max_bytes_per_s=100000000)
        loud, other = self.dial(driver, 1), self.dial(driver, 2)
        scans = Recorder("/hero_1/laser", rospy.AnyMsg)
        reader = subprocess.Popen(
            ["rostopic", "echo", "/hero_1/laser"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        self.addCleanup(reader.wait)
        self.addCleanup(reader.kill)
        wait_for(lambda: has_connection(driver.node, "/hero_1/laser", "rostopic"), "the reader to be connected")
        encoders = Recorder("/hero_2/encoder", Encoder)
        # The socket buffers of the system hold some MB; this is more.
        payload = stock_messages.make_laser("hero_1", rospy.Time(3), [0.1] * 8) + bytes(3500)
        with suspended(reader.pid):
            for count in range(1, 41):
                for _ in range(100):
                    loud.send("laser", payload)
                self.send_encoder(other, float(count))
                self.assert_time_is_answered(other)
            self.assertEqual(encoders.wait_count(40)[-1].left_ticks, 40.0)
            self.assert_time_is_answered(loud)
            # A reader that does read gets all there is.
            wait_for(lambda: scans.messages, "scans at the other reader")
            self.assertTrue(loud.is_connected)

    def test_many_returns_leave_no_threads_sockets_or_topics_behind(self):
        driver = self.start(grace_s=600.0)

        def come_and_go(rounds):
            for _ in range(rounds):
                robot = self.dial(driver, 1, ready=False)
                wait_for(lambda: driver.fleet.find("/hero_1", Robot.READY), "hero_1")
                robot.close()
                driver.fleet.wait("/hero_1", Robot.AWAY)

        # What waits for the ROS master is dropped when a robot leaves.
        robot = self.dial(driver, 1)
        wait_for(lambda: len(list_driver_topics("/hero_1", driver.node)) == 19, "all topics and services")
        robot.close()
        driver.fleet.wait("/hero_1", Robot.AWAY)
        come_and_go(3)
        topics = list_driver_topics("/hero_1", driver.node)
        before = count_resources(driver.process.pid)
        come_and_go(10)
        self.assertEqual(list_driver_topics("/hero_1", driver.node), topics)
        wait_for(
            lambda: all(now <= then for now, then in nonempty(zip(count_resources(driver.process.pid), before))),
            lambda: (
                "no more than %s sockets and threads, there are %s" % (before, count_resources(driver.process.pid))
            ),
        )

    def test_robots_that_leave_for_good_leave_nothing_behind(self):
        driver = self.start(grace_s=0.0)

        def come_and_go(numbers):
            for number in numbers:
                robot = self.dial(driver, number)
                wait_for(lambda n=robot.namespace: len(list_driver_topics(n, driver.node)) == 19, "its topics")
                robot.close()
                driver.fleet.wait_gone(robot.namespace)
                wait_for(lambda n=robot.namespace: not list_driver_topics(n, driver.node), "an empty place")

        come_and_go(range(1, 4))
        before = count_resources(driver.process.pid)
        come_and_go(range(4, 9))
        wait_for(
            lambda: all(now <= then for now, then in nonempty(zip(count_resources(driver.process.pid), before))),
            lambda: (
                "no more than %s sockets and threads, there are %s" % (before, count_resources(driver.process.pid))
            ),
        )


if __name__ == "__main__":
    rospy.init_node("test_driver_endurance")
    rostest.rosrun("hero_driver", "driver_endurance", TestDriverEndurance)
