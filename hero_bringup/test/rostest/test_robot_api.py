#!/usr/bin/env python3
"""Robot and Swarm as a user's program has them, judged by the simulator's ground truth."""

import math
import signal
import subprocess
import sys
import unittest

import rospy
import rostest

from hero_client import Robot, Swarm
from hero_client.errors import GoalError, RobotNotReadyError, StaleDataError
from hero_sim.srv import InjectFault
from hero_test.light_watch import LightWatch
from hero_test.swarm_watch import SwarmWatch
from hero_test.waiting import wait_for

ROBOTS = 6
CORNERED = 4
"""hero_4 stands in the corner: a wall 0.12 m ahead of its center, another 0.16 m to its left."""

DEADLINE_S = 30.0

DRIVE_FOR_EVER = """
from hero_client import Robot
with Robot(2) as robot:
    robot.wait_until_ready(timeout_s=10)
    robot.drive(0.1, 0.0, duration_s=600)
"""


def cause_fault(text):
    answer = rospy.ServiceProxy("/hero_sim/fault", InjectFault)(text)
    assert answer.success, answer.message


class RobotApiTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.watch = SwarmWatch(range(ROBOTS))
        cls.watch.wait_until_complete(60.0)
        cls.swarm = wait_for(cls.discover_all, "a swarm of all simulated robots")
        cls.swarm.wait_until_ready(timeout_s=DEADLINE_S)

    @staticmethod
    def discover_all():
        """Return what discover finds, once that is everybody: it returns as soon as there is one robot."""
        swarm = Swarm.discover(timeout_s=DEADLINE_S)
        return swarm if len(swarm) == ROBOTS else swarm.close()

    def speed(self, robot_id):
        """Return the true speed ahead, m/s."""
        return self.watch.rows[robot_id][-1][4]

    def test_01_a_swarm_holds_the_robots_that_the_driver_reports(self):
        self.assertEqual(list(range(ROBOTS)), [robot.robot_id for robot in self.swarm])
        self.assertEqual("hero_3", self.swarm[3].name)
        with self.assertRaisesRegex(KeyError, "hero_9"):
            self.swarm[9]
        with self.assertRaisesRegex(ValueError, "more than once"):
            Swarm([1, 1])

    def test_02_a_timed_drive_goes_its_way_and_ends_at_rest(self):
        robot = self.swarm[0]
        before, true_before = robot.pose, self.watch.pose(0)
        robot.drive(0.1, 0.0, duration_s=2.0)
        self.watch.wait_until_stopped(0)
        true_way_m = math.dist(true_before[:2], self.watch.pose(0)[:2])
        self.assertGreater(true_way_m, 0.1)
        wait_for(
            lambda: abs(math.dist(before[:2], robot.pose[:2]) - true_way_m) < 0.01, "odometry that knows the way", 2.0
        )

    def test_03_velocity_says_how_the_robot_moves_until_it_is_stopped(self):
        robot = self.swarm[0]

        def drives_back_and_turns():
            robot.drive(-0.05, 1.0)
            is_told = robot.velocity.linear_m_s < -0.03 and robot.velocity.angular_rad_s > 0.7
            # The truth of one moment: the wheels' controller lets it swing.
            return is_told and self.speed(0) < -0.02

        wait_for(drives_back_and_turns, "velocity that follows the command, and is true")
        robot.stop()
        self.watch.wait_until_stopped(0)

    def test_04_speeds_beyond_the_robot_are_cut(self):
        robot = self.swarm[1]

        def is_fast():
            robot.drive(9.0, 0.0)
            return self.speed(1) > 0.15

        wait_for(is_fast, "full speed")
        self.assertLess(max(row[4] for row in self.watch.rows[1]), 0.22)
        robot.stop()
        self.watch.wait_until_stopped(1)
        with self.assertRaisesRegex(ValueError, "finite"):
            robot.drive(math.nan, 0.0)

    def test_05_proximity_begins_ahead_and_goes_round_to_the_left(self):
        robot = self.swarm[CORNERED]
        ranges = robot.proximity
        self.assertEqual(8, len(ranges))
        self.assertAlmostEqual(0.12, ranges[0], delta=0.02)
        self.assertAlmostEqual(0.16, ranges[2], delta=0.03)
        for index in (4, 5, 6):  # behind, and to the right: free
            self.assertEqual(math.inf, ranges[index])
        nearest = robot.nearest()
        self.assertAlmostEqual(0.12, nearest.range_m, delta=0.02)
        self.assertAlmostEqual(0.0, nearest.bearing_rad, places=6)
        self.assertIsNone(self.swarm[0].nearest())

    def test_06_lights_show_the_color_that_was_asked_for(self):
        lights = LightWatch()
        self.swarm[0].led("green")
        self.swarm[1].led((1.0, 0.0, 0.0))
        wait_for(lambda: lights.is_lit(0, (0.0, 1.0, 0.0)) and lights.is_lit(1, (1.0, 0.0, 0.0)), "two lights")
        self.swarm.led("blue")
        wait_for(lambda: all(lights.is_lit(i, (0.0, 0.0, 1.0)) for i in range(ROBOTS)), "blue everywhere")
        with self.assertRaisesRegex(ValueError, "pink.*there are: .*green"):
            self.swarm[0].led("pink")
        lights.close()

    def test_07_go_to_returns_when_the_robot_stands_in_its_place_and_heading(self):
        robot = self.swarm[0]
        start, true_start = robot.pose, self.watch.pose(0)
        robot.go_to(start.x_m + 0.15, start.y_m, yaw_rad=start.yaw_rad + 1.5, timeout_s=40.0)
        self.watch.wait_until_stopped(0)
        true_pose = self.watch.pose(0)
        turn_rad = true_start[2] - start.yaw_rad
        goal = (true_start[0] + 0.15 * math.cos(turn_rad), true_start[1] + 0.15 * math.sin(turn_rad))
        self.assertLess(math.dist(goal, true_pose[:2]), 0.02)
        self.assertLess(abs(math.remainder(true_pose[2] - true_start[2] - 1.5, 2.0 * math.pi)), 0.12)

    def test_08_two_robots_go_at_once_and_their_futures_tell_the_end(self):
        starts = {robot_id: self.swarm[robot_id].pose for robot_id in (1, 2)}
        true_starts = {robot_id: self.watch.pose(robot_id) for robot_id in starts}
        futures = [
            self.swarm[robot_id].start_go_to(pose.x_m - 0.1, pose.y_m, timeout_s=40.0)
            for robot_id, pose in starts.items()
        ]
        self.assertFalse(any(future.done() for future in futures))
        for future in futures:
            future.result(timeout=DEADLINE_S)
        for robot_id, true_start in true_starts.items():
            self.assertAlmostEqual(0.1, math.dist(true_start[:2], self.watch.pose(robot_id)[:2]), delta=0.015)

    def test_09_a_goal_not_reached_in_time_is_an_error_with_the_distance_left(self):
        with self.assertRaisesRegex(GoalError, r"hero_0 did not reach .* not there after 1 s, [0-9.]+ m are left"):
            self.swarm[0].go_to(50.0, 0.0, timeout_s=1.0)
        self.watch.wait_until_stopped(0)
        with self.assertRaisesRegex(GoalError, "not there after 0.5 s"):
            self.swarm[0].start_go_to(50.0, 0.0, timeout_s=0.5).result(timeout=DEADLINE_S)

    def test_10_a_robot_that_is_not_there_is_told_by_name(self):
        absent = Robot(77)
        with self.assertRaisesRegex(RobotNotReadyError, "hero_77 is not ready after 0.5 s: nothing subscribes to"):
            absent.wait_until_ready(timeout_s=0.5)
        with self.assertRaisesRegex(StaleDataError, "no message on /hero_77/odom yet"):
            _ = absent.pose
        with self.assertRaisesRegex(StaleDataError, "no message on /hero_77/proximity yet"):
            absent.nearest()
        absent.close()
        for wrong in ("0", -1, True, 1.5):
            with self.assertRaisesRegex(ValueError, "named by its number"):
                Robot(wrong)

    def test_11_data_of_a_robot_that_fell_silent_are_refused_until_it_is_back(self):
        robot = self.swarm[3]
        future = robot.start_go_to(robot.pose.x_m + 0.1, robot.pose.y_m)
        cause_fault("vanish:robot=3,for=4")
        with self.assertRaisesRegex(GoalError, "no odometry for 2 s"):
            future.result(timeout=DEADLINE_S)
        with self.assertRaisesRegex(StaleDataError, r"/hero_3/odom came [0-9.]+ s ago: has the robot gone"):
            _ = robot.pose
        with self.assertRaises(StaleDataError):
            _ = robot.velocity
        with self.assertRaises(StaleDataError):
            _ = robot.proximity
        robot.wait_until_ready(timeout_s=DEADLINE_S)
        self.assertIsNotNone(robot.pose)

    def test_12_leaving_a_with_block_stops_the_robot_also_after_an_error(self):
        def drive_and_fail():
            with Robot(1) as robot:
                robot.wait_until_ready(timeout_s=DEADLINE_S)

                def moves():
                    robot.drive(0.1, 0.0)
                    return self.speed(1) > 0.05

                wait_for(moves, "motion")
                raise RuntimeError("a mistake in the user's program")

        with self.assertRaisesRegex(RuntimeError, "mistake"):
            drive_and_fail()
        self.watch.wait_until_stopped(1)

    def test_13_a_swarm_that_was_only_watched_is_not_stopped(self):
        driver = self.swarm[0]

        def moves():
            driver.drive(0.05, 0.0)
            return self.speed(0) > 0.03

        wait_for(moves, "motion")
        with Swarm([0, 1]) as watchers:
            watchers.wait_until_ready(timeout_s=DEADLINE_S)
            wait_for(moves, "motion")
        self.assertGreater(self.speed(0), 0.02)
        self.swarm.stop()
        self.watch.wait_until_stopped(0)

    def test_14_a_plain_script_that_is_ended_leaves_its_robot_standing(self):
        for number, code in ((signal.SIGINT, -signal.SIGINT), (signal.SIGTERM, 143), (signal.SIGHUP, 129)):
            script = subprocess.Popen([sys.executable, "-c", DRIVE_FOR_EVER], stderr=subprocess.PIPE)
            wait_for(lambda: self.speed(2) > 0.05, "motion by the script")
            script.send_signal(number)
            errors = script.communicate(timeout=DEADLINE_S)[1].decode()
            self.watch.wait_until_stopped(2)
            self.assertEqual(code, script.returncode, errors)
            self.assertNotIn("Traceback", errors)

    def test_15_a_plain_script_without_its_robot_ends_with_one_line(self):
        code = "from hero_client import Robot; Robot(77).wait_until_ready(timeout_s=0.2)"
        ended = subprocess.run([sys.executable, "-c", code], stderr=subprocess.PIPE, text=True, check=False)
        self.assertEqual(1, ended.returncode)
        self.assertRegex(ended.stderr, r"\A-c: hero_77 is not ready after 0.2 s: [^\n]*\n\Z")


if __name__ == "__main__":
    rospy.init_node("test_robot_api")
    rostest.rosrun("hero_bringup", "robot_api", RobotApiTest, sys.argv)
