#!/usr/bin/env python3
"""go_to_goal's actions and topics, each test with a robot of its own; its motions are tried in virtual time."""

import math
import sys
import unittest

import actionlib
import rospy
import rostest
from actionlib_msgs.msg import GoalStatus
from geometry_msgs.msg import PoseStamped

from hero_msgs.msg import GoToAction, GoToGoal
from hero_test.waiting import TIMEOUT_S, wait_for
from hero_test.watches.command_watch import CommandWatch
from hero_test.watches.swarm_watch import SwarmWatch

ROBOTS = (20, 22, 25, 26)

NEAR_M = 0.05
"""Half of the longest way to a goal. A robot of a starved machine overshoots; its accuracy is tried in virtual time."""


def make_goal(x_m, y_m, yaw_rad, frame="world"):
    target = PoseStamped()
    target.header.frame_id = frame
    target.pose.position.x, target.pose.position.y = x_m, y_m
    target.pose.orientation.z, target.pose.orientation.w = math.sin(yaw_rad / 2.0), math.cos(yaw_rad / 2.0)
    return GoToGoal(target=target, use_heading=True)


class GoToGoalTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.watch, cls.commands = SwarmWatch(ROBOTS), CommandWatch(ROBOTS)
        cls.watch.wait_until_complete(60.0)

    def connect(self, robot_id):
        client = actionlib.SimpleActionClient("/hero_%d/go_to" % robot_id, GoToAction)
        self.assertTrue(client.wait_for_server(rospy.Duration(TIMEOUT_S)))
        return client

    def choose_place(self, robot_id, distance_m=0.05):
        """Return a place ahead of the robot, and its heading."""
        x_m, y_m, yaw_rad = self.watch.pose(robot_id)
        return x_m + distance_m * math.cos(yaw_rad), y_m + distance_m * math.sin(yaw_rad), yaw_rad

    def wait_for_result(self, client):
        self.assertTrue(client.wait_for_result(rospy.Duration(TIMEOUT_S)))
        return client.get_result()

    def wait_until_at(self, robot_id, place):
        def is_there():
            x_m, y_m, yaw_rad = self.watch.pose(robot_id)
            is_near = math.dist((x_m, y_m), place[:2]) < NEAR_M
            return is_near and abs(math.remainder(yaw_rad - place[2], math.tau)) < 0.3

        wait_for(is_there, lambda: "hero_%d, at %s, to be at %s" % (robot_id, self.watch.pose(robot_id), place))

    def test_an_action_moves_the_robot_tells_of_its_way_and_succeeds(self):
        client, place, feedback = self.connect(20), self.choose_place(20, 0.1), []
        client.send_goal(make_goal(*place), feedback_cb=feedback.append)
        result = self.wait_for_result(client)
        self.assertEqual((GoalStatus.SUCCEEDED, True, ""), (client.get_state(), result.reached, result.reason))
        self.assertLess(result.distance, 0.02)
        wait_for(lambda: len(feedback) > 1, "feedback")  # it may come after the result
        self.assertLess(feedback[-1].distance, feedback[0].distance)
        self.assertGreater(feedback[-1].elapsed, feedback[0].elapsed)
        self.commands.wait_for_stops(20)
        self.watch.wait_until_stopped(20)
        self.wait_until_at(20, place)

    def test_a_cancelled_robot_stops(self):
        client = self.connect(22)
        client.send_goal(make_goal(*self.choose_place(22, 0.6)))
        wait_for(lambda: self.watch.rows[22][-1][4] > 0.03, "motion")
        client.cancel_goal()
        self.assertEqual("cancelled", self.wait_for_result(client).reason)
        self.commands.wait_for_stops(22)
        self.watch.wait_until_stopped(22)

    def test_a_goal_that_is_no_place_is_rejected_with_the_reason(self):
        client = self.connect(25)
        client.send_goal(make_goal(math.nan, 0.0, 0.0))
        self.assertIn("must be finite", self.wait_for_result(client).reason)
        self.assertEqual(GoalStatus.REJECTED, client.get_state())

    def test_a_goal_on_the_topic_moves_the_robot_there(self):
        publisher, place = rospy.Publisher("/hero_26/goal", PoseStamped, queue_size=1), self.choose_place(26, 0.1)
        wait_for(lambda: publisher.get_num_connections() > 0, "go_to_goal's subscriber")
        publisher.publish(make_goal(*place).target)
        wait_for(lambda: math.dist(self.watch.pose(26)[:2], place[:2]) < NEAR_M, "the robot at its goal")
        self.commands.wait_for_stops(26)


if __name__ == "__main__":
    rospy.init_node("test_go_to_goal")
    rostest.rosrun("hero_examples", "go_to_goal", GoToGoalTest, sys.argv)
