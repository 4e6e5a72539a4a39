#!/usr/bin/env python3
"""The main job with simulated robots: they are driven, calibrated and stopped."""

import re
import unittest
from pathlib import Path

import rospy
import rostest
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

from hero_msgs.msg import Robot, RobotArray
from hero_msgs.srv import SetIRCalibration, SetMotor, SetOdom
from hero_test.nonempty import nonempty
from hero_test.waiting import wait_for

DEADLINE_S = 60.0
ROBOTS = (0, 1, 2)


class Watch:
    """The newest message of a topic, and how many came."""

    def __init__(self, topic, message_class):
        self.newest = None
        self.count = 0
        self._topic = topic
        self._subscriber = rospy.Subscriber(topic, message_class, self._receive, tcp_nodelay=True)

    def _receive(self, message):
        self.newest = message
        self.count += 1

    def wait_more(self, count=1):
        """Wait for so many messages from now on; return the newest."""
        seen = self.count
        wait_for(lambda: self.count >= seen + count, "%d more messages on %s" % (count, self._topic))
        return self.newest


class Driven:
    """A robot that is told to move at 10 Hz until it is told otherwise."""

    def __init__(self, number):
        namespace = "/hero_%d" % number
        self.odom = Watch(namespace + "/odom", Odometry)
        self.truth = Watch(namespace + "/ground_truth", Odometry)
        self.publisher = rospy.Publisher(
            namespace + "/velocity_controller/cmd_vel", Twist, queue_size=1, tcp_nodelay=True
        )
        wait_for(lambda: self.publisher.get_num_connections() > 0, "the driver at cmd_vel of " + namespace)
        self.odom.wait_more()
        self.truth.wait_more()
        self._command = Twist()
        self._timer = rospy.Timer(rospy.Duration(0.1), lambda _: self.publisher.publish(self._command))

    def turn(self, turn_rad_s):
        """Go on with this velocity."""
        self._command = Twist()
        self._command.angular.z = turn_rad_s

    @property
    def is_at_rest(self):
        """Whether the simulator says that it stands, and odom too."""
        return all(
            abs(watch.newest.twist.twist.linear.x) < 0.005 and abs(watch.newest.twist.twist.angular.z) < 0.1
            for watch in (self.truth, self.odom)
        )

    def close(self):
        """Stop the robot, so that the next test finds it at rest, and say nothing any more."""
        self._timer.shutdown()
        self._timer.join()
        self.publisher.publish(Twist())
        wait_for(lambda: self.is_at_rest, "the robot to stop")


class DriverDrivesTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.fleet = Watch("/hero_driver/robots", RobotArray)
        cls.scans = {number: Watch("/hero_%d/proximity" % number, LaserScan) for number in ROBOTS}
        numbers = set(ROBOTS)
        wait_for(
            lambda: (
                cls.fleet.newest
                and {robot.id for robot in cls.fleet.newest.robots if robot.state == Robot.READY} == numbers
            ),
            "three robots",
        )
        # In its first 3 s a robot's position controller holds it in place (20 messages per simulated second).
        Watch("/hero_0/ground_truth", Odometry).wait_more(65)

    def take(self, number):
        robot = Driven(number)
        self.addCleanup(robot.close)
        return robot

    def call(self, name, service_class, *arguments):
        rospy.wait_for_service(name, DEADLINE_S)
        return rospy.ServiceProxy(name, service_class)(*arguments)

    def test_three_robots_are_calibrated_and_driven_through_one_driver(self):
        for number in ROBOTS:
            namespace = "/hero_%d" % number
            calls = (
                ("/ir_calibration", SetIRCalibration, [0.42] * 8),
                ("/motors_parameters", SetMotor, (1500, 1500)),
                ("/set_odom", SetOdom, (1.0, 2.0, 0.0)),
            )
            for name, service_class, arguments in calls:
                answer = self.call(namespace + name, service_class, *arguments)
                self.assertTrue(answer.success, "%s: %s" % (namespace + name, answer.message))
        robots = [self.take(number) for number in ROBOTS]
        for robot in robots:
            wait_for(
                lambda r=robot: abs(r.odom.newest.pose.pose.position.x - 1.0) < 0.01,
                lambda r=robot: "x = 1 m, where odom says %s" % r.odom.newest.pose.pose,
            )
            robot.turn(1.5)
        for robot in robots:
            wait_for(lambda r=robot: r.truth.newest.twist.twist.angular.z > 0.7, "the robot to turn")
            self.assertAlmostEqual(robot.odom.newest.pose.pose.position.y, 2.0, delta=0.02)

    def test_every_robot_scans_with_eight_beams_and_sends_all_its_frames(self):
        for watch in nonempty(self.scans.values()):
            scan = watch.wait_more()
            self.assertEqual(len(scan.ranges), 8)
        frames = set()

        def receive(message):
            frames.update(transform.child_frame_id for transform in message.transforms)

        subscriber = rospy.Subscriber("/tf", TFMessage, receive)
        self.addCleanup(subscriber.unregister)
        expected = {
            "hero_%d/%s" % (number, link)
            for number in ROBOTS
            for link in ("base_link", "left_wheel_link", "right_wheel_link", "hat_link", "laser_link")
        }
        wait_for(lambda: expected <= frames, "all frames of all robots")

    def test_the_aggregator_configuration_sorts_every_diagnostic_once(self):
        config = yaml.safe_load((Path(__file__).parents[2] / "config" / "diagnostics.yaml").read_text())
        groups = {name: [] for name in config["analyzers"]}
        for status in nonempty(Watch("/diagnostics", DiagnosticArray).wait_more().status):
            matching = [
                name for name, group in config["analyzers"].items() if re.fullmatch(group["regex"], status.name)
            ]
            self.assertEqual(len(matching), 1, status.name)
            groups[matching[0]].append(status.name.rpartition(": ")[2])
        self.assertEqual(groups["drivers"], ["driver"])
        self.assertEqual(sorted(groups["robots"]), ["hero_0", "hero_1", "hero_2"])
        self.assertEqual(set(groups), {"drivers", "robots"})


if __name__ == "__main__":
    rospy.init_node("test_driver_drives")
    rostest.rosrun("hero_bringup", "driver_drives", DriverDrivesTest)
