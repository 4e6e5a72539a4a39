#!/usr/bin/env python3
"""A driver that can start no thread, and what goes on while the ROS master hangs."""

import http.client
import resource
import xmlrpc.client

import rosgraph
import rospy
import rostest
from std_msgs.msg import ColorRGBA

from hero_driver.rosserial import packets
from hero_msgs.msg import Encoder, Robot
from hero_test import stock_messages
from hero_test.driver_case import OwnDriverCase, Recorder, make_publisher, wait_packets, wait_payloads
from hero_test.fake_robot import TIME_PACKET
from hero_test.processes import suspended
from hero_test.waiting import wait_for


class TestDriverLimits(OwnDriverCase):
    def test_a_driver_that_can_start_no_thread_for_a_program_ends(self):
        driver = self.start()
        robot = self.dial(driver, 30)
        with open("/proc/%d/statm" % driver.process.pid, encoding="utf-8") as file:
            used_length = int(file.read().split()[0]) * resource.getpagesize()
        limit = used_length + 4 * 2**20  # half the stack of a thread
        resource.prlimit(driver.process.pid, resource.RLIMIT_AS, (limit, limit))
        # Each open connection has a thread; the stacks of some that have ended are used again.
        uri = rosgraph.Master("/test").lookupNode(driver.node)
        connections = [xmlrpc.client.ServerProxy(uri) for _ in range(20)]
        with self.assertRaises((OSError, http.client.HTTPException)):
            for connection in connections:
                connection.getPid("/test")
        driver.wait_line("hero_driver ends, as .* no thread can be started: free memory")
        self.assertEqual(driver.wait_end(), 1, driver.lines)
        wait_for(lambda: robot.ended, "the connection to be closed")

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


if __name__ == "__main__":
    rospy.init_node("test_driver_limits")
    rostest.rosrun("hero_driver", "driver_limits", TestDriverLimits)
