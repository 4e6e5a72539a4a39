#!/usr/bin/env python3
"""Who is let in, how much one robot may send, and what goes on while the ROS master hangs."""

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
from hero_test.fake_robot import (
    PUB,
    STOCK_DECLARATIONS,
    TIME_PACKET,
    Declaration,
)
from hero_test.processes import suspended
from hero_test.stock_messages import STRING_MD5
from hero_test.waiting import wait_for


class TestDriverLimits(OwnDriverCase):
    """Who is let in, and how much of it."""

    def wait_refused(self, driver, robot, pattern):
        wait_for(lambda: robot.ended, "the connection to be closed")
        line = driver.wait_line(pattern)
        self.assertIn("127.0.0.", line)
        return line

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

    def test_more_connections_than_allowed_are_refused_and_those_there_go_on(self):
        driver = self.start(max_connections=2)
        first, second = self.dial(driver, 1), self.dial(driver, 2)
        for _ in range(10):
            extra = self.dial(driver, 3, ready=False)
            self.wait_refused(driver, extra, "refused: .*~max_connections")
        self.assertEqual(len(driver.find_lines("refused: .*~max_connections")), 1)
        self.assertTrue(first.is_connected and second.is_connected)
        second.close()
        driver.fleet.wait("/hero_2", Robot.AWAY)
        self.dial(driver, 3)

    def test_more_unidentified_connections_than_allowed_are_refused(self):
        driver = self.start(max_unidentified=2)
        nobodies = [self.dial(driver, ready=False, declarations=[]) for _ in range(2)]
        for nobody in nobodies:
            wait_for(lambda r=nobody: r.requests, "a request")
        self.wait_refused(driver, self.dial(driver, 1, ready=False), "~max_unidentified")
        nobodies[0].close()

        def look():
            robot = self.dial(driver, 1, ready=False)
            wait_for(lambda: robot.ended or driver.fleet.find("/hero_1", Robot.READY), "an end or a beginning")
            return not robot.ended

        wait_for(look, "the place to be free")

    def test_more_topics_than_allowed_are_refused_and_the_first_ones_work(self):
        driver = self.start(max_topics=24)
        extra = [Declaration(PUB, 150, "/{}/extra", "std_msgs/String", STRING_MD5)]
        robot = self.dial(driver, 1, declarations=[*STOCK_DECLARATIONS, *extra])
        driver.wait_line("topic /hero_1/extra refused: more than 24 topics .*max_topics")
        encoders = Recorder("/hero_1/encoder", Encoder)
        robot.send("encoder", stock_messages.make_encoder("hero_1", rospy.Time.now(), 1.0, 1.0))
        encoders.wait_count(1)

    def test_a_robot_that_sends_too_much_is_disconnected_with_the_reason(self):
        driver = self.start(max_packets_per_s=300, max_bytes_per_s=200000)
        quiet, flooding, fat = self.dial(driver, 1), self.dial(driver, 2), self.dial(driver, 3)
        flooding.send_bytes(TIME_PACKET * 400)
        self.wait_refused(driver, flooding, "hero_2 left .*300 packets per second .*~max_packets_per_s")
        fat.send_bytes(packets.encode_packet(125, bytes(4000)) * 60)
        self.wait_refused(driver, fat, "hero_3 left .*200000 bytes per second .*~max_bytes_per_s")
        self.assertTrue(quiet.is_connected)
        self.assertEqual(driver.fleet.find("/hero_1").reconnects, 0)

    def test_packets_longer_than_allowed_are_counted_as_bad(self):
        driver = self.start(max_payload_length=2048)
        robot = self.dial(driver, 1)
        encoders = Recorder("/hero_1/encoder", Encoder)
        robot.send_packet(128, bytes(3000))
        robot.send("encoder", stock_messages.make_encoder("hero_1", rospy.Time.now(), 1.0, 1.0))
        encoders.wait_count(1)
        driver.fleet.wait("/hero_1", Robot.READY, "counted", lambda e: e.bad_packets >= 1)

    def test_a_flood_of_log_lines_is_limited_and_others_are_heard(self):
        driver = self.start()
        chatty, quiet = self.dial(driver, 1), self.dial(driver, 2)
        for index in range(600):
            chatty.log("line %d" % index)
        quiet.log("I am here")
        driver.wait_line("hero_2: I am here")
        driver.fleet.wait("/hero_1", Robot.READY, "dropped lines", lambda e: e.dropped_messages > 0)
        self.assertLess(len(driver.find_lines("hero_1: line")), 600)

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
