#!/usr/bin/env python3
"""Fifty seeded goals through the action, ten robots at once, judged by the simulator's ground truth."""

import math
import random
import sys
import unittest

import actionlib
import rospy
import rostest
from actionlib_msgs.msg import GoalStatus
from geometry_msgs.msg import PoseStamped

from hero_msgs.msg import GoToAction, GoToGoal
from hero_test.swarm_watch import SwarmWatch
from hero_test.waiting import wait_for

ROBOTS = 10
GOALS_EACH = 5

REACH_M = 0.25
"""Goals are drawn in a square of this half side around a robot's start: the plots do not overlap."""

TRUE_TOLERANCE_M = 0.015
"""The node's tolerance of 0.01 m, and what odometry and its link to the world may be off."""

TURN_TOLERANCE_RAD = 0.12


def make_goal(x_m, y_m, yaw_rad, frame="world"):
    target = PoseStamped()
    target.header.frame_id = frame
    target.pose.position.x, target.pose.position.y = x_m, y_m
    target.pose.orientation.z, target.pose.orientation.w = math.sin(yaw_rad / 2.0), math.cos(yaw_rad / 2.0)
    return GoToGoal(target=target, use_heading=True)


class GoToGoalTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.watch = SwarmWatch(range(ROBOTS))
        cls.watch.wait_until_complete(60.0)
        cls.starts = {robot_id: cls.watch.pose(robot_id) for robot_id in range(ROBOTS)}
        cls.clients = {
            robot_id: actionlib.SimpleActionClient("/hero_%d/go_to" % robot_id, GoToAction)
            for robot_id in range(ROBOTS)
        }
        for client in cls.clients.values():
            assert client.wait_for_server(rospy.Duration(30.0))

    def send(self, goals):
        """Send {robot: (x, y, yaw)} and wait for all results."""
        for robot_id, goal in goals.items():
            self.clients[robot_id].send_goal(make_goal(*goal))
        for robot_id in goals:
            self.assertTrue(self.clients[robot_id].wait_for_result(rospy.Duration(90.0)), robot_id)

    def test_1_fifty_goals_of_fifty_are_reached_and_no_robot_swings_there(self):
        rng = random.Random(5)
        for _ in range(GOALS_EACH):
            goals = {
                robot_id: (
                    start[0] + rng.uniform(-REACH_M, REACH_M),
                    start[1] + rng.uniform(-REACH_M, REACH_M),
                    rng.uniform(-math.pi, math.pi),
                )
                for robot_id, start in self.starts.items()
            }
            begun = {robot_id: len(self.watch.rows[robot_id]) for robot_id in goals}
            self.send(goals)
            for robot_id, goal in goals.items():
                result = self.clients[robot_id].get_result()
                self.assertTrue(result.reached, result.reason)
                x_m, y_m, yaw_rad = self.watch.pose(robot_id)
                self.assertLess(math.hypot(x_m - goal[0], y_m - goal[1]), TRUE_TOLERANCE_M)
                self.assertLess(abs(math.remainder(yaw_rad - goal[2], 2.0 * math.pi)), TURN_TOLERANCE_RAD)
                self.assert_did_not_swing(robot_id, goal, begun[robot_id])

    def assert_did_not_swing(self, robot_id, goal, first_row):
        """Once within the tolerance, the robot stays: it does not pass the goal and come back."""
        rows = self.watch.path(robot_id)[first_row:]
        distances_m = [math.hypot(x_m - goal[0], y_m - goal[1]) for _, x_m, y_m, _, _ in rows]
        arrived = next(index for index, distance_m in enumerate(distances_m) if distance_m < 0.01)
        self.assertLess(max(distances_m[arrived:]), 2.0 * TRUE_TOLERANCE_M)

    def test_2_a_new_goal_takes_the_place_of_the_old_one(self):
        start = self.starts[0]
        first = actionlib.SimpleActionClient("/hero_0/go_to", GoToAction)
        self.assertTrue(first.wait_for_server(rospy.Duration(30.0)))
        feedback = []
        first.send_goal(make_goal(start[0] + 0.25, start[1] + 0.25, 0.0), feedback_cb=feedback.append)
        wait_for(lambda: feedback, "feedback")
        self.send({0: start})
        self.assertTrue(self.clients[0].get_result().reached)
        wait_for(lambda: first.get_state() == GoalStatus.PREEMPTED, "the end of the first goal")
        self.assertEqual("another goal came", first.get_result().reason)

    def test_3_a_cancelled_robot_stands(self):
        start = self.starts[1]
        client = self.clients[1]
        client.send_goal(make_goal(start[0] + 0.25, start[1] - 0.25, 0.0))
        wait_for(lambda: self.watch.rows[1][-1][4] > 0.03, "motion")
        client.cancel_goal()
        self.assertTrue(client.wait_for_result(rospy.Duration(10.0)))
        self.assertEqual("cancelled", client.get_result().reason)
        wait_for(lambda: abs(self.watch.rows[1][-1][4]) < 0.001, "rest", 3.0)

    def test_4_a_goal_in_an_unknown_frame_fails_with_the_frames_name(self):
        client = self.clients[2]
        client.send_goal(make_goal(0.0, 0.0, 0.0, frame="nowhere"))
        self.assertTrue(client.wait_for_result(rospy.Duration(20.0)))
        self.assertFalse(client.get_result().reached)
        self.assertIn("nowhere", client.get_result().reason)

    def test_5_a_goal_on_the_topic_moves_the_robot_there(self):
        publisher = rospy.Publisher("/hero_3/goal", PoseStamped, queue_size=1)
        wait_for(lambda: publisher.get_num_connections() > 0, "go_to_goal's subscriber")
        x_m, y_m, _ = self.starts[3]
        publisher.publish(make_goal(x_m, y_m, 1.0).target)

        def is_there():
            pose = self.watch.pose(3)
            turned_rad = abs(math.remainder(pose[2] - 1.0, 2.0 * math.pi))
            return math.hypot(pose[0] - x_m, pose[1] - y_m) < TRUE_TOLERANCE_M and turned_rad < TURN_TOLERANCE_RAD

        wait_for(is_there, "the robot at the goal from the topic")


if __name__ == "__main__":
    rospy.init_node("test_go_to_goal")
    rostest.rosrun("hero_examples", "go_to_goal", GoToGoalTest, sys.argv)
