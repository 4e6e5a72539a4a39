#!/usr/bin/env python3
"""Commands to robots: a stop always arrives, twice, and an old command never does.

That commands are far enough apart for the firmware is a matter of the driver's clock: see
hero_driver/test/unit/test_peer_commands.py.
"""

import math
import struct

import rospy
import rostest
from geometry_msgs.msg import Twist
from rosgraph_msgs.msg import Log as RosLog
from std_msgs.msg import Bool, ColorRGBA
from std_srvs.srv import SetBool

from hero_msgs.msg import Motor, Robot
from hero_msgs.srv import SetOdom
from hero_test.driver_case import NODE, DriverCase, Recorder, make_command, make_publisher, wait_payloads
from hero_test.processes import Program
from hero_test.waiting import wait_for

VELOCITY = "velocity_controller/cmd_vel"


class TestDriverCommands(DriverCase):
    def setUp(self):
        self.call_stop(False)

    def call_stop(self, stopped):
        rospy.wait_for_service(NODE + "/stop", 60.0)
        self.assertTrue(rospy.ServiceProxy(NODE + "/stop", SetBool)(stopped).success)

    def wait_stopped(self, robot):
        """Wait until the last that a robot has got are two stops."""
        wait_for(
            lambda: [velocity.is_zero for velocity in robot.velocities[-2:]] == [True, True],
            lambda: "two stops at %s, got %s" % (robot.name, robot.velocities[-6:]),
        )

    def test_a_stop_right_after_a_burst_is_never_lost(self):
        robots = [self.join(number) for number in (1, 2, 3)]
        publishers = [make_publisher("%s/%s" % (robot.namespace, VELOCITY), Twist) for robot in robots]
        for _ in range(5):
            for _ in range(12):
                for publisher in publishers:
                    publisher.publish(make_command(0.1))
            for publisher in publishers:
                publisher.publish(make_command(0.0))
            for robot in robots:
                self.wait_stopped(robot)
                del robot.velocities[:]

    def test_other_commands_are_not_shaped_and_do_not_wait_for_motion(self):
        robot = self.join(10)
        drive = make_publisher("/hero_10/" + VELOCITY, Twist)
        light = make_publisher("/hero_10/led", ColorRGBA)
        switch = make_publisher("/hero_10/laser_enable", Bool)
        rospy.wait_for_service("/hero_10/set_odom", 60.0)
        for index in range(20):
            drive.publish(make_command(0.001 * index + 0.001))
            light.publish(ColorRGBA(float(index), 0.0, 0.0, 0.0))
            switch.publish(Bool(index % 2 == 0))
        self.assertTrue(rospy.ServiceProxy("/hero_10/set_odom", SetOdom)(0.0, 0.0, 0.0).success)
        self.assertEqual(
            [struct.unpack("<4f", payload)[0] for payload in wait_payloads(robot, "led", 20)], list(range(20))
        )
        self.assertEqual(wait_payloads(robot, "laser_enable", 20), [b"\x01", b"\x00"] * 10)

    def test_of_cmd_vel_and_the_velocity_controllers_the_newest_wins(self):
        robot = self.join(20)
        alias = make_publisher("/hero_20/cmd_vel", Twist)
        controller = make_publisher("/hero_20/" + VELOCITY, Twist)
        for publisher, linear_m_s in ((alias, 0.05), (controller, 0.1), (alias, 0.15)):
            publisher.publish(make_command(linear_m_s))
            wait_for(
                lambda v=linear_m_s: robot.velocities and robot.velocities[-1].linear_m_s == v, "the newest command"
            )
        controller.publish(make_command(0.0))
        self.wait_stopped(robot)
        self.assertEqual({velocity.name.rpartition("hero_20/")[2] for velocity in robot.velocities}, {VELOCITY})

    def start_commander(self, robot, linear_m_s):
        """Start a node that commands a robot until the test ends; return its name once the robot was sent a command."""
        name = "/commander_of_" + robot.name
        command = "{linear: {x: %s}}" % linear_m_s
        topic = robot.namespace + "/cmd_vel"
        program = Program("rostopic", "pub", "-r", "20", topic, "geometry_msgs/Twist", command, "__name:=" + name[1:])
        self.addCleanup(program.end)
        payload = struct.pack("<6d", linear_m_s, 0, 0, 0, 0, 0)
        wait_for(lambda: payload in robot.payloads_on(VELOCITY), "a command of " + name)
        return name

    def test_two_programs_that_command_one_robot_are_both_named(self):
        robot = self.join(31)
        publisher = make_publisher("/hero_31/" + VELOCITY, Twist)
        name = self.start_commander(robot, 0.05)

        def find_warning():
            publisher.publish(make_command(0.1))
            return self.find_logs("hero_31 is commanded by")

        line = wait_for(find_warning, "the warning")[0]
        self.assertEqual(line.level, RosLog.WARN)
        for part in (name, rospy.get_name(), "end one of them"):
            self.assertIn(part, line.msg)

    def test_non_finite_velocities_are_refused_and_reported_once(self):
        robot = self.join(11)
        publisher = make_publisher("/hero_11/" + VELOCITY, Twist)
        bad = [make_command(math.nan), make_command(0.1, math.inf), make_command(-math.inf)]
        unused = make_command(0.1)
        unused.linear.y = math.nan
        for command in (*bad, unused, *bad):
            publisher.publish(command)
        publisher.publish(make_command(0.05))
        wait_for(lambda: robot.velocities, "the good command")
        self.assertEqual([velocity.linear_m_s for velocity in robot.velocities], [0.05])
        self.fleet.wait("/hero_11", Robot.READY, "with refusals", lambda e: e.dropped_messages == 7)
        self.wait_log("hero_11: .*not finite")
        self.assertEqual(len(self.find_logs("hero_11: .*not finite")), 1)

    def test_the_stop_service_stops_every_robot_until_released(self):
        stopped = Recorder(NODE + "/stopped", Bool)
        robots = [self.join(number) for number in (13, 14)]
        publishers = [make_publisher("%s/%s" % (robot.namespace, VELOCITY), Twist) for robot in robots]
        motor = make_publisher("/hero_13/cmd_motor", Motor)
        for publisher in publishers:
            publisher.publish(make_command(0.1))
        for robot in robots:
            wait_for(lambda r=robot: r.velocities, "the motion")
        self.call_stop(True)
        for robot in robots:
            self.wait_stopped(robot)
        wait_for(lambda: stopped.messages and stopped.messages[-1].data, "the latched state")
        wait_for(lambda: self.fleet.newest.stopped, "the report")
        for publisher in publishers:
            publisher.publish(make_command(0.1))
        motor.publish(Motor(1400, 1600))
        # Lights are no motion.
        make_publisher("/hero_13/led", ColorRGBA).publish(ColorRGBA(1.0, 0.0, 0.0, 0.0))
        wait_payloads(robots[0], "led")
        self.fleet.wait("/hero_13", Robot.READY, "refusals", lambda e: e.dropped_messages >= 2)
        self.fleet.wait("/hero_14", Robot.READY, "refusals", lambda e: e.dropped_messages >= 1)
        for robot in robots:
            motions = [velocity for velocity in robot.velocities if not velocity.is_zero]
            self.assertEqual([velocity.linear_m_s for velocity in motions], [0.1])
        self.assertEqual(robots[0].payloads_on("cmd_motor"), [])
        self.call_stop(False)
        wait_for(lambda: not stopped.messages[-1].data, "the latched state")
        for publisher, robot in zip(publishers, robots):
            publisher.publish(make_command(0.07))
            wait_for(lambda r=robot: r.velocities[-1].linear_m_s == 0.07, "the motion")

    def test_a_robot_that_does_not_read_gets_the_newest_command_and_no_backlog(self):
        stalled = self.join(19, receive_buffer_length=4096)
        other = self.join(24)
        drive = make_publisher("/hero_19/" + VELOCITY, Twist)
        light = make_publisher("/hero_19/led", ColorRGBA)
        other_drive = make_publisher("/hero_24/" + VELOCITY, Twist)
        other_light = make_publisher("/hero_24/led", ColorRGBA)
        stalled.is_stalled = True

        def is_full():
            for _ in range(100):
                light.publish(ColorRGBA(1.0, 0.0, 0.0, 0.0))
            # The first are dropped where an acknowledgement is late, while the window still has room.
            return self.fleet.find("/hero_19").dropped_messages > 1000

        wait_for(is_full, "drops: its TCP window and its queue to be full")
        for step in range(1, 51):
            drive.publish(make_command(step / 1000.0))
            other_light.publish(ColorRGBA(float(step), 0.0, 0.0, 0.0))
            # Nobody else is delayed.
            wait_payloads(other, "led", step)
        other_drive.publish(make_command(0.1))
        wait_for(lambda: other.velocities, "the other robot's command")
        stalled.is_stalled = False

        def has_newest():
            # Again and again: who commanded regularly and falls silent is replaced by a stop.
            drive.publish(make_command(0.15))
            return stalled.velocities and stalled.velocities[-1].linear_m_s == 0.15

        wait_for(has_newest, "the newest command")
        # One may have been on its way, and no other follows before that one is acknowledged.
        older = [velocity for velocity in stalled.velocities if velocity.linear_m_s != 0.15]
        self.assertLessEqual(len(older), 1)


if __name__ == "__main__":
    rospy.init_node("test_driver_commands")
    rostest.rosrun("hero_driver", "driver_commands", TestDriverCommands)
