#!/usr/bin/env python3
"""explore.launch: simulated robots are localized in map, drive to where it ends, and map the arena."""

import math
import sys
import unittest

import rospy
import rostest
from nav_msgs.msg import OccupancyGrid
from std_msgs.msg import Float32
from tf2_msgs.msg import TFMessage

from hero_client import FrameError, StaleDataError, Swarm
from hero_test.waiting import wait_for
from hero_test.watches.swarm_watch import SwarmWatch

ROBOTS = range(3)


def read_poses(swarm):
    """Return the poses of all robots; None while one is not known: on a busy machine they come late."""
    try:
        return swarm.poses
    except (FrameError, StaleDataError):
        return None


class ExploreTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.shares, cls.maps, cls.parents = [], [], {}
        cls.watch = SwarmWatch(ROBOTS)
        rospy.Subscriber("/map_arena/known_share", Float32, lambda message: cls.shares.append(message.data))
        rospy.Subscriber("/map", OccupancyGrid, cls.maps.append)
        for topic in ("/tf", "/tf_static"):
            rospy.Subscriber(topic, TFMessage, cls.note_parents, queue_size=100)
        cls.watch.wait_until_complete(60.0)
        cls.starts = {robot_id: cls.watch.pose(robot_id) for robot_id in ROBOTS}

    @classmethod
    def note_parents(cls, message):
        for transform in message.transforms:
            cls.parents.setdefault(transform.child_frame_id, set()).add(transform.header.frame_id)

    def test_robots_drive_and_the_map_grows(self):
        wait_for(lambda: self.shares and self.maps, "a map")
        first = self.shares[0]
        wait_for(lambda: self.shares[-1] > first + 0.02, lambda: "a larger map than %s" % self.shares)
        self.assertEqual("map", self.maps[-1].header.frame_id)
        wait_for(
            lambda: any(math.dist(self.starts[i][:2], self.watch.pose(i)[:2]) > 0.05 for i in ROBOTS), "a robot away"
        )

    def test_only_the_localization_places_robots(self):
        wait_for(lambda: "hero_0/odom" in self.parents, "a transform to hero_0/odom")
        wait_for(lambda: "hero_0/base_link" in self.parents, "the robot's own transforms")
        self.assertEqual({"map"}, self.parents["hero_0/odom"])

    def was_near(self, robot_id, pose):
        """Return whether a robot, which drives on meanwhile, has been within 2 cm of a pose in the last 10 s."""
        return any(math.dist(pose[:2], row[1:3]) < 0.02 for row in self.watch.path(robot_id)[-200:])

    def test_programs_get_the_poses_of_all_robots_without_tf(self):
        swarm = Swarm(ROBOTS, proximity=False)
        swarm.wait_until_ready(60.0)
        poses = wait_for(lambda: read_poses(swarm), "fresh poses of all robots")
        self.assertEqual(list(ROBOTS), sorted(poses))
        for robot_id, pose in poses.items():
            wait_for(lambda at=pose, robot_id=robot_id: self.was_near(robot_id, at), "hero_%d to be there" % robot_id)
        with self.assertRaisesRegex(FrameError, "hero_7 .*localize does not know it"):
            Swarm([7]).poses  # noqa: B018 - it raises


if __name__ == "__main__":
    rospy.init_node("test_explore")
    rostest.rosrun("hero_bringup", "test_explore", ExploreTest, sys.argv)
