#!/usr/bin/env python3
"""Robot and Swarm over ROS: discovery, data, commands, lights and ends reach robots that the driver has.

What their methods make of it is tested in virtual time: hero_sim/test/unit/test_sim_step_*.py.
"""

import math
import re
import sys
import unittest

import rospy
import rostest

from hero_client import FrameError, Robot, RobotNotReadyError, StaleDataError, Swarm
from hero_client.values import MODELS
from hero_sim.srv import InjectFault
from hero_test.waiting import wait_for
from hero_test.watches.light_watch import LightWatch
from hero_test.watches.swarm_watch import SwarmWatch

ROBOTS = 6
CORNERED = 4
"""hero_4 stands in the corner: a wall 0.12 m ahead of its center, another 0.16 m to its left."""

DEADLINE_S = 60.0

PLUS = 5
"""hero_5 is a HeRo+ that looks along the room, 3 m long."""

DARK = (0.15, 0.15, 0.15)
"""A light that is off, as the simulator shows it."""


def read(robot, name):
    """Return a property of a robot once it is fresh: on a busy machine it may be too old for a moment."""

    def try_reading():
        try:
            return (getattr(robot, name),)
        except StaleDataError:
            return None

    return wait_for(try_reading, f"fresh data for {name}")[0]


ABSENT = r"nothing subscribes to /hero_9/velocity_controller/cmd_vel: connected are hero_0, .*hero_5"


class RobotApiTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.watch = SwarmWatch(range(ROBOTS))
        cls.watch.wait_until_complete(60.0)
        cls.lights = LightWatch()
        cls.swarm = wait_for(cls.discover_all, "a swarm of all simulated robots")
        cls.swarm.wait_until_ready(timeout_s=DEADLINE_S)

    @staticmethod
    def discover_all():
        """Return what discover finds, once that is everybody: it returns as soon as there is one robot."""
        swarm = Swarm.discover(timeout_s=DEADLINE_S)
        return swarm if len(swarm) == ROBOTS else swarm.close()

    def moves(self, robot_id):
        return self.watch.rows[robot_id][-1][4] > 0.03

    def test_a_swarm_holds_the_robots_that_the_driver_reports(self):
        self.assertEqual(list(range(ROBOTS)), [robot.robot_id for robot in self.swarm])
        is_ready = re.compile("<Swarm of hero_0, .*: 6 of 6 ready>").fullmatch
        wait_for(lambda: is_ready(repr(self.swarm)), lambda: repr(self.swarm))  # on a busy machine data may be old
        with self.assertRaisesRegex(ValueError, "more than once"):
            Swarm([1, 1])
        for wrong in ("0", -1, True, 1.5):
            with self.assertRaisesRegex(ValueError, "named by its number"):
                Robot(wrong)

    def test_commands_move_robots_and_odometry_knows_it(self):
        robot, true_before = self.swarm[0], self.watch.pose(0)
        before = wait_for(robot.fresh_pose, "a pose")  # `pose` raises where a busy machine is late

        def drives_back_and_turns():
            robot.drive(-0.05, 1.0)
            velocity = robot.fresh_velocity()
            follows = velocity and velocity.linear_m_s < -0.03 and velocity.angular_rad_s > 0.7
            return follows and self.watch.rows[0][-1][4] < -0.02

        wait_for(drives_back_and_turns, "velocity that follows the command, and is true")
        robot.drive(0.1, 0.0, duration_s=0.5)
        robot.stop()
        wait_for(lambda: self.watch.at_rest(0), "rest")

        def knows():
            pose = robot.fresh_pose()
            distance_m = math.dist(before[:2], pose[:2]) if pose else math.inf
            return abs(distance_m - math.dist(true_before[:2], self.watch.pose(0)[:2])) < 0.01

        wait_for(knows, "odometry that knows where the robot is")

    def test_data_are_read_as_the_robot_has_them(self):
        robot = self.swarm[CORNERED]
        for ranges in (read(robot, "proximity"), robot.wait_for_scan()):
            self.assertEqual(8, len(ranges))
            self.assertAlmostEqual(0.12, ranges[0], delta=0.02)
            self.assertAlmostEqual(0.16, ranges[2], delta=0.03)
            self.assertEqual([math.inf] * 3, ranges[4:7])  # behind, and to the right: free
        self.assertAlmostEqual(0.12, min(robot.wait_for_scan()), delta=0.02)
        self.assertEqual("hero_4/odom", robot.odometry.header.frame_id)
        robot.drive(0.0, 1.0, duration_s=0.3)
        wait_for(lambda: read(robot, "encoder").left_ticks != 0, "ticks of wheels that turned")
        counts, ranges_m = read(robot, "infrared_counts"), robot.wait_for_scan()
        self.assertEqual(8, len(counts))
        self.assertEqual(ranges_m.index(min(ranges_m)), counts.index(max(counts)))
        wait_for(lambda: read(robot, "wheel_speeds") == (0.0, 0.0), "rest")
        robot.set_pose(1.0, -2.0, 0.5)
        self.assertLess(math.dist((1.0, -2.0, 0.5), read(robot, "pose")), 0.02)
        wait_for(lambda: repr(robot).startswith("<hero_4: ready, Pose(x_m="), lambda: repr(robot))
        wait_for(lambda: abs(read(robot, "encoder").left_ticks) < 3, "ticks that set_odom zeroed")

    def test_a_robot_of_another_model_is_read_as_what_it_is(self):
        stock, plus = self.swarm[0], self.swarm[PLUS]
        self.assertEqual(MODELS["hero"], stock.model)
        self.assertEqual(MODELS["hero_plus"], plus.model)
        distance_m = read(plus, "distance")
        self.assertTrue(0.2 < distance_m < 2.6, distance_m)

        def measure_separation():
            plus.drive(0.0, 2.0)
            before, (left_m_s, right_m_s) = read(plus, "velocity"), read(plus, "wheel_speeds")
            after = read(plus, "velocity")
            return before == after and after.angular_rad_s > 1.0 and (right_m_s - left_m_s) / after.angular_rad_s

        separation_m = wait_for(measure_separation, "wheels that turn")
        plus.stop()
        self.assertAlmostEqual(0.065, separation_m)

    def test_goals_and_poses_may_be_in_a_frame_of_tf(self):
        robot, before = self.swarm[2], self.watch.pose(2)
        goal = (before[0] - 0.03, before[1])
        robot.go_to(*goal, frame="world")
        wait_for(lambda: math.dist(goal, self.watch.pose(2)[:2]) < 0.02, "hero_2 at its goal")
        wait_for(lambda: math.dist(robot.pose_in("world")[:2], self.watch.pose(2)[:2]) < 0.02, "its pose in world")
        with self.assertRaisesRegex(FrameError, "no transform from hero_2/odom to nowhere"):
            robot.pose_in("nowhere", timeout_s=0.1)

    def test_lights_show_the_color_that_was_asked_for_and_blink(self):
        self.swarm.led("blue")
        wait_for(lambda: all(self.lights.is_lit(i, (0.0, 0.0, 1.0)) for i in range(ROBOTS)), "blue everywhere")
        robot = self.swarm[5]
        robot.blink("red", period_s=0.4)
        for _ in range(2):
            wait_for(lambda: self.lights.is_lit(5, (1.0, 0.0, 0.0)), "light")
            wait_for(lambda: self.lights.is_lit(5, DARK), "darkness")
        robot.led("green")
        wait_for(lambda: self.lights.is_lit(5, (0.0, 1.0, 0.0)), "green")

    def test_commands_to_a_robot_that_is_absent_are_warned_about_once(self):
        absent = Robot(9)
        with self.assertLogs("rosout", "WARNING") as log:
            for _ in range(3):
                absent.drive(0.1, 0.0)
            absent.stop()
        self.assertEqual(1, len(log.output), log.output)
        self.assertRegex(log.output[0], "a command is lost: " + ABSENT)
        with self.assertRaisesRegex(RobotNotReadyError, "hero_9 is not ready after 0.1 s: " + ABSENT):
            absent.wait_until_ready(timeout_s=0.1)
        with self.assertRaisesRegex(StaleDataError, "no message on /hero_9/odom yet"):
            _ = absent.pose
        self.assertRegex(repr(absent), "<hero_9: " + ABSENT)  # before, it may still be connecting
        absent.close()

    def test_data_of_a_robot_that_fell_silent_are_refused_until_it_is_back(self):
        robot = self.swarm[3]
        answer = rospy.ServiceProxy("/hero_sim/fault", InjectFault)("vanish:robot=3,for=8")
        self.assertTrue(answer.success, answer.message)
        wait_for(lambda: robot.fresh_pose() is None, "a pose that is too old")
        with self.assertRaisesRegex(StaleDataError, r"/hero_3/odom came [0-9.]+ s ago: has the robot gone"):
            _ = robot.pose
        robot.wait_until_ready(timeout_s=DEADLINE_S)
        wait_for(lambda: robot.fresh_pose() is not None, "a pose")

    def test_a_with_block_stops_only_robots_that_were_driven_in_it(self):
        driver = self.swarm[0]

        def is_driven():
            driver.drive(0.05, 0.0)
            return self.moves(0)

        wait_for(is_driven, "motion")
        with Swarm([0, 1]) as watchers:
            watchers.wait_until_ready(timeout_s=DEADLINE_S)
            driver.drive(0.05, 0.0)
            self.assertFalse(any(robot.driven for robot in watchers))
        with Robot(1) as robot:
            robot.wait_until_ready(timeout_s=DEADLINE_S)
            robot.drive(0.1, 0.0)
            wait_for(lambda: self.moves(1), "motion")
        self.assertTrue(robot.driven)
        self.swarm.stop()
        wait_for(lambda: self.watch.at_rest(0, 1), "rest")


if __name__ == "__main__":
    rospy.init_node("test_robot_api")
    rostest.rosrun("hero_bringup", "robot_api", RobotApiTest, sys.argv)
