#!/usr/bin/env python3
"""Ten robots swap places across a circle, judged by the simulator's ground truth."""

import math
import sys
import unittest

import rospy
import rostest

from hero_test.swarm_watch import SwarmWatch
from hero_test.waiting import wait_for

ROBOTS = 10

TRUE_TOLERANCE_M = 0.03
"""The node's tolerance of 0.01 m, twice that for a robot that has arrived, and what odometry may be off."""


class SwarmGoToTest(unittest.TestCase):
    def test_ten_robots_swap_places_on_a_circle_without_touching(self):
        watch = SwarmWatch(range(ROBOTS))
        watch.wait_until_complete(60.0)
        goals = {}
        for robot_id in range(ROBOTS):
            angle = 2.0 * math.pi * robot_id / ROBOTS
            goals[robot_id] = (-0.6 * math.cos(angle), -0.6 * math.sin(angle))

        def all_rest():
            moved = all(
                math.dist(watch.pose(robot_id)[:2], goal) < TRUE_TOLERANCE_M for robot_id, goal in goals.items()
            )
            return moved and all(rows[-1][4] == 0.0 for rows in watch.rows.values())

        wait_for(all_rest, "all robots at rest on the other side", 100.0)
        watch.close()
        off_m = {robot_id: round(math.dist(watch.pose(robot_id)[:2], goal), 3) for robot_id, goal in goals.items()}
        sys.stdout.write("least gap %.4f m, off %s\n" % (watch.least_gap_m(), off_m))
        self.assertGreater(watch.least_gap_m(), 0.005)


if __name__ == "__main__":
    rospy.init_node("test_swarm_go_to")
    rostest.rosrun("hero_examples", "swarm_go_to", SwarmGoToTest, sys.argv)
