#!/usr/bin/env python3
"""The end of the driver: every robot takes a stop, and only then is its connection closed."""

import signal
import socket

import rospy
import rostest
from geometry_msgs.msg import Twist

from hero_driver.rosserial import packets
from hero_msgs.msg import Motor, Robot
from hero_test.driver_case import OwnDriverCase, make_command, make_publisher, wait_payloads
from hero_test.fake_robot import READ_CYCLE_S
from hero_test.waiting import wait_for

VELOCITY = "velocity_controller/cmd_vel"


class TestDriverShutdown(OwnDriverCase):
    def drive(self, driver, robots):
        """Let all robots move."""
        for robot in robots:
            driver.fleet.wait_ready(robot.namespace)
        publishers = [make_publisher("%s/%s" % (robot.namespace, VELOCITY), Twist) for robot in robots]
        for publisher in publishers:
            publisher.publish(make_command(0.1))
        for robot in robots:
            wait_for(lambda r=robot: r.motors.is_turning, "motion of " + robot.name)
        return publishers

    def assert_stopped(self, robots):
        """Each robot took a stop, stops were the last that it got, and then its connection ended."""
        for robot in robots:
            wait_for(lambda r=robot: r.ended, "the end of the connection of " + robot.name)
            last = [velocity for velocity in robot.velocities if velocity.name.endswith("/" + VELOCITY)][-2:]
            self.assertEqual([velocity.is_zero for velocity in last], [True, True], robot.name)
            self.assertFalse(robot.motors.is_turning, robot.name)
            # While unconfigured the firmware runs no watchdog, so this must never reach a moving robot.
            self.assertEqual(robot.payloads_with_id(packets.ID_TX_STOP), [])

    def dial_stock(self, driver, number, **settings):
        """Return a robot that takes commands as the firmware does."""
        return self.dial(driver, number, ready=False, read_cycle_s=READ_CYCLE_S, **settings)

    def end_by(self, number, count=3):
        driver = self.start()
        robots = [self.dial_stock(driver, robot_number) for robot_number in range(1, count + 1)]
        self.drive(driver, robots)
        driver.process.send_signal(number)
        self.assertEqual(driver.wait_end(), 0, driver.lines)
        self.assert_stopped(robots)
        self.assertEqual(driver.find_lines("Traceback"), [])

    def test_a_closed_terminal_stops_every_robot(self):
        self.end_by(signal.SIGHUP)

    def test_rosnode_kill_stops_every_robot(self):
        driver = self.start()
        robots = [self.dial_stock(driver, number) for number in (1, 2)]
        self.drive(driver, robots)
        code, _, uri = rospy.get_master().lookupNode(driver.node)
        self.assertEqual(code, 1)
        rospy.core.xmlrpcapi(uri).shutdown("/test", "killed by a test")
        self.assertEqual(driver.wait_end(), 0, driver.lines)
        self.assert_stopped(robots)

    def test_sigterm_stops_each_of_fifty_robots(self):
        self.end_by(signal.SIGTERM, 50)

    def test_commands_that_still_come_do_not_outlast_the_stop(self):
        driver = self.start()
        robots = [self.dial_stock(driver, 1, has_motors=True)]
        publisher = self.drive(driver, robots)[0]
        driver.process.send_signal(signal.SIGINT)

        def has_ended():
            publisher.publish(make_command(0.2))
            return robots[0].ended

        wait_for(has_ended, "the end of the connection")
        driver.wait_end()
        self.assert_stopped(robots)

    def test_a_robot_that_does_not_read_does_not_keep_others_from_their_stop(self):
        driver = self.start()
        stalled = self.dial(driver, 1, receive_buffer_length=4096)
        others = [self.dial_stock(driver, number) for number in (2, 3)]
        self.drive(driver, [stalled, *others])
        stalled.is_stalled = True
        driver.process.send_signal(signal.SIGINT)
        self.assertEqual(driver.wait_end(), 0, driver.lines)
        self.assert_stopped(others)

    def test_direct_motor_commands_and_position_control_are_stopped_too(self):
        driver = self.start()
        robot = self.dial(driver, 1)
        make_publisher("/hero_1/cmd_motor", Motor).publish(Motor(1400, 1600))
        make_publisher("/hero_1/position_controller/cmd_vel", Twist).publish(make_command(0.1))
        wait_payloads(robot, "cmd_motor")
        wait_payloads(robot, "position_controller/cmd_vel")
        driver.process.send_signal(signal.SIGINT)
        driver.wait_end()
        wait_for(lambda: robot.ended, "the end of the connection")
        self.assertEqual(len(robot.payloads_on("cmd_motor")), 1)  # zeros end servo pulses, too
        self.assertEqual(robot.payloads_on("position_controller/cmd_vel")[-2:], [bytes(48)] * 2)
        self.assertEqual(robot.payloads_on(VELOCITY)[-2:], [bytes(48)] * 2)

    def test_a_second_driver_can_take_the_port_of_the_first_at_once(self):
        first = self.start()
        self.dial(first, 1)
        port = first.address[1]
        first.process.send_signal(signal.SIGINT)
        first.wait_end()
        second = self.start(port=port)
        self.assertEqual(second.address[1], port)
        self.dial(second, 1)
        self.assertEqual(second.fleet.find("/hero_1", Robot.READY).reconnects, 0)

    def test_a_driver_without_robots_ends_quietly(self):
        driver = self.start()
        driver.wait_line("listening on 0.0.0.0:")
        with socket.create_connection(driver.address) as nobody:
            self.assertTrue(nobody.recv(1))
            driver.process.send_signal(signal.SIGINT)
            self.assertEqual(driver.wait_end(), 0)
        self.assertEqual(driver.find_lines("ERROR|FATAL|Traceback|unidentified"), [])


if __name__ == "__main__":
    rospy.init_node("test_driver_shutdown")
    rostest.rosrun("hero_driver", "driver_shutdown", TestDriverShutdown)
