#!/usr/bin/env python3
"""Who is here: arrival, return, power cycle, a second robot with the same id, silence, and the reports about it."""

import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Twist
from std_msgs.msg import ColorRGBA
from std_srvs.srv import Trigger

from hero_msgs.msg import Encoder, Robot
from hero_msgs.srv import SetOdom
from hero_test import stock_messages
from hero_test.driver_case import (
    NODE,
    DriverCase,
    Recorder,
    list_driver_topics,
    make_publisher,
    wait_payloads,
)
from hero_test.fake_robot import FakeRobot, boot_line, heartbeat_line
from hero_test.waiting import wait_for

OTHER_HOST = "127.0.0.2"


class TestDriverFleet(DriverCase):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.diagnostics = Recorder("/diagnostics", DiagnosticArray)

    def find_status(self, name):
        """Return the newest diagnostic status of the driver whose name ends in name, None if there is none."""
        for message in reversed(list(self.diagnostics.messages)):
            statuses = [status for status in message.status if status.name.startswith(NODE.lstrip("/"))]
            if statuses:
                return next((status for status in statuses if status.name.endswith(": " + name)), None)
        return None

    def wait_status(self, name, level, text=""):
        def look():
            status = self.find_status(name)
            return status if status and status.level == level and text in status.message else None

        return wait_for(look, lambda: "status %r, %r, last: %s" % (level, text, self.find_status(name)))

    def send_encoder(self, robot, left_ticks):
        robot.send("encoder", stock_messages.make_encoder(robot.name, rospy.Time.now(), left_ticks, 0.0))

    def test_an_arrival_is_reported_with_all_that_is_known(self):
        robot = self.join(1)
        robot.log(boot_line("hero_1"))
        robot.log(heartbeat_line("hero_1", 77.0))
        entry = self.fleet.wait("/hero_1", Robot.READY, "with uptime", lambda e: e.uptime.to_sec() >= 77)
        self.assertEqual((entry.id, entry.address, entry.reconnects), (1, robot.address, 0))
        self.assertEqual((entry.firmware, entry.hardware, entry.config), ("v3.8", "v2.5", "v2.3"))
        self.assertLessEqual(entry.since.to_sec(), rospy.Time.now().to_sec())
        self.assertLess(entry.uptime.to_sec(), 200.0)
        self.assertEqual((entry.last_error, entry.bad_packets), ("", 0))
        wait_for(  # the first status is OK, too: it says that diagnostics start
            lambda: robot.address in [value.value for value in self.wait_status("hero_1", DiagnosticStatus.OK).values],
            "the robot's address in its diagnostics",
        )
        self.assertTrue(self.wait_status("driver", DiagnosticStatus.OK))

    def test_rates_bad_packets_and_clock_offset_are_counted(self):
        robot = self.join(2)
        ahead = rospy.Duration(1.5)
        bad_packet = b"\xff\xfe\x01\x00\x00garbage"
        robot.send_bytes(bad_packet)

        def look():
            stock_messages.send_burst(robot, 0.0, 0.0, rospy.Time.now() + ahead)
            entry = self.fleet.find("/hero_2")
            return entry if entry.packets_per_s > 7 and entry.clock_offset > 1.0 and entry.bad_packets else None

        entry = wait_for(look, lambda: "rates, last: %s" % self.fleet.newest)
        self.assertGreater(entry.bytes_per_s, 100 * entry.packets_per_s)
        self.assertLess(entry.clock_offset, 1.6)
        self.wait_status("hero_2", DiagnosticStatus.WARN, "clock")

    def test_a_return_within_the_grace_period_keeps_everything_up(self):
        robot = self.join(3)
        encoders = Recorder("/hero_3/encoder", Encoder)
        command = make_publisher("/hero_3/velocity_controller/cmd_vel", Twist)
        rospy.wait_for_service("/hero_3/set_odom", 60.0)
        service = rospy.ServiceProxy("/hero_3/set_odom", SetOdom)
        rospy.wait_for_service("/hero_3/velocity_controller/pid_calibration", 60.0)  # declared last
        topics = list_driver_topics("/hero_3")
        self.send_encoder(robot, 1.0)
        encoders.wait_count(1)
        connection = encoders.subscriber.impl.connections[0]
        robot.close()
        away = self.fleet.wait("/hero_3", Robot.AWAY)
        self.assertIn("closed by the robot", away.last_error)
        self.wait_status("hero_3", DiagnosticStatus.ERROR, "away")
        self.assertEqual(list_driver_topics("/hero_3"), topics)
        returned = self.join(3)
        entry = self.fleet.wait("/hero_3", Robot.READY, "again", lambda e: e.reconnects == 1)
        self.assertEqual(entry.address, returned.address)
        self.send_encoder(returned, 2.0)
        self.assertEqual([m.left_ticks for m in encoders.wait_count(2)], [1.0, 2.0])
        self.assertIs(encoders.subscriber.impl.connections[0], connection)
        twist = Twist()
        twist.linear.x = 0.1
        command.publish(twist)
        wait_payloads(returned, "velocity_controller/cmd_vel")
        self.assertTrue(service(0.0, 0.0, 0.0).success)

    def test_after_the_grace_period_a_robot_is_forgotten_and_may_come_again(self):
        robot = self.join(4)
        Recorder("/hero_4/encoder", Encoder)
        robot.close()
        self.fleet.wait("/hero_4", Robot.AWAY)
        self.fleet.wait_gone("/hero_4")
        wait_for(lambda: "/hero_4" in [robot.namespace for robot in self.fleet.newest.gone], "its entry as gone")
        wait_for(lambda: not list_driver_topics("/hero_4"), "topics to be taken down")
        wait_for(lambda: self.find_status("hero_4") is None, "its diagnostics to go")
        again = self.join(4)
        encoders = Recorder("/hero_4/encoder", Encoder)
        self.send_encoder(again, 3.0)
        self.assertEqual(encoders.wait_count(1)[0].left_ticks, 3.0)
        self.assertEqual(self.fleet.find("/hero_4").reconnects, 0)
        self.assertNotIn("/hero_4", [robot.namespace for robot in self.fleet.newest.gone])
        again.close()
        wait_for(lambda: "/hero_4" in [robot.namespace for robot in self.fleet.newest.gone], "its entry as gone")
        dismissed = rospy.ServiceProxy(NODE + "/dismiss_gone", Trigger)()
        self.assertIn("hero_4", dismissed.message)
        wait_for(lambda: not self.fleet.newest.gone, "an empty list")

    def test_a_power_cycle_without_fin_takes_over_at_once(self):
        old = self.join(6)
        encoders = Recorder("/hero_6/encoder", Encoder)
        command = make_publisher("/hero_6/led", ColorRGBA)
        self.send_encoder(old, 1.0)
        encoders.wait_count(1)
        old.is_silent = True  # no power, and nobody who could say so
        new = FakeRobot(6)
        self.addCleanup(new.close)
        new.connect(self.address)
        new.log(boot_line("hero_6"))
        entry = self.fleet.wait("/hero_6", Robot.READY, "anew", lambda e: e.address == new.address)
        self.assertEqual(entry.reconnects, 1)
        wait_for(lambda: old.ended, "the old connection to be closed")
        self.send_encoder(new, 2.0)
        self.assertEqual([m.left_ticks for m in encoders.wait_count(2)], [1.0, 2.0])
        command.publish(ColorRGBA(1.0, 1.0, 1.0, 1.0))
        wait_payloads(new, "led")
        self.assertEqual(old.payloads_on("led"), [])
        self.assertEqual(self.fleet.find("/hero_6", Robot.AWAY), None)

    def test_of_two_robots_with_one_id_the_second_is_refused(self):
        first = self.join(7)
        encoders = Recorder("/hero_7/encoder", Encoder)
        light = make_publisher("/hero_7/led", ColorRGBA)
        second = self.join(7, ready=False, source_host=OTHER_HOST)
        refused = self.fleet.wait("/hero_7", Robot.REFUSED)
        self.assertIn(first.address, refused.last_error)
        self.assertIn(second.address, refused.last_error)
        self.assertEqual(refused.address, second.address)
        status = self.wait_status("hero_7", DiagnosticStatus.ERROR, "two robots")
        self.assertIn(second.address, status.message)
        self.assertEqual(self.fleet.find("/hero_7", Robot.READY).address, first.address)
        self.wait_log("two robots call themselves /hero_7: %s .*%s" % (first.address, second.address))
        self.send_encoder(second, 66.0)
        self.send_encoder(first, 7.0)
        self.assertEqual(encoders.wait_count(1)[0].left_ticks, 7.0)
        light.publish(ColorRGBA(1.0, 1.0, 1.0, 1.0))
        wait_payloads(first, "led")
        self.assertEqual(second.payloads_on("led"), [])
        # The first one loses its connection, and gets its id back, although the second dials in at once.
        first.close()
        self.fleet.wait("/hero_7", Robot.AWAY)
        second.close()
        second.connect(self.address)
        self.fleet.wait("/hero_7", Robot.REFUSED, "", lambda e: e.address == second.address)
        first.connect(self.address)
        self.fleet.wait("/hero_7", Robot.READY, "", lambda e: e.address == first.address)
        self.assertTrue(second.is_connected)
        # When it stays away for the grace period, the second may have the id, as soon as it dials again.
        first.close()

        def look():
            if not second.is_connected:
                second.close()
                second.connect(self.address)
            entry = self.fleet.find("/hero_7", Robot.READY)
            return entry is not None and entry.address == second.address

        wait_for(look, "the second robot to join")
        self.wait_log("hero_7 has left")
        self.assertIsNone(self.fleet.find("/hero_7", Robot.REFUSED))

    def test_a_silent_robot_is_away_and_its_connection_is_closed(self):
        robot = self.join(9)
        robot.is_silent = True
        away = self.fleet.wait("/hero_9", Robot.AWAY)
        self.assertIn("silent", away.last_error)
        wait_for(lambda: robot.ended, "the connection to be closed")
        self.wait_log("hero_9 left .*silent")

    def test_a_connection_that_declares_nothing_is_asked_again_then_closed(self):
        robot = FakeRobot(11, declarations=[])
        self.addCleanup(robot.close)
        robot.connect(self.address)
        wait_for(lambda: robot.ended, "the connection to be closed")
        self.assertGreaterEqual(robot.requests, 2)
        self.wait_log("did not identify itself as a robot within 10.0 s")
        self.assertIsNone(self.fleet.find("/hero_11"))

    def test_twenty_robots_at_once_all_join_and_are_listed_in_order(self):
        robots = [self.join(number, ready=False) for number in range(120, 100, -1)]
        for robot in robots:
            self.fleet.wait_ready(robot.namespace)
        names = [entry.namespace for entry in self.fleet.newest.robots if entry.id > 100]
        self.assertEqual(names, ["/hero_%d" % number for number in range(101, 121)])


if __name__ == "__main__":
    rospy.init_node("test_driver_fleet")
    rostest.rosrun("hero_driver", "driver_fleet", TestDriverFleet)
