#!/usr/bin/env python3
"""The node localize with driver and simulator: a motion capture system of this test measures the robots."""

import copy
import math
import sys
import threading
import unittest

import cv2
import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray, PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from rosgraph_msgs.msg import Log
from std_msgs.msg import Float32
from std_srvs.srv import Trigger

from hero_client import FrameError, Robot, StaleDataError, Swarm
from hero_localization.nodes.map_arena import OCCUPIED
from hero_msgs.msg import RobotPose, RobotPoses
from hero_node import yaw_of
from hero_test.nonempty import nonempty
from hero_test.waiting import wait_for

TOLERANCE_M = 0.01
"""The ground truth comes 20 times a second, with the simulator's stamps of arrival: 4 mm apart at 0.08 m/s."""


class MotionCapture:
    """Measures robots by the simulator's ground truth, in its frame; one can be covered, or measured elsewhere."""

    def __init__(self, *robot_ids):
        self.covered = set()
        self.shift_m = {}
        self.frame = "map"
        self.poses = {}
        self.lock = threading.Lock()
        self.publishers = {
            robot_id: rospy.Publisher("/hero_%d/measured_pose" % robot_id, PoseStamped, queue_size=5)
            for robot_id in robot_ids
        }
        for robot_id in robot_ids:
            rospy.Subscriber("/hero_%d/ground_truth" % robot_id, Odometry, self.measure, robot_id, queue_size=5)

    def measure(self, truth, robot_id):
        with self.lock:
            self.poses[robot_id] = truth.pose.pose
            if robot_id in self.covered:
                return
            message = PoseStamped(pose=copy.deepcopy(truth.pose.pose))
            message.header.stamp = truth.header.stamp
            message.header.frame_id = self.frame
            message.pose.position.x += self.shift_m.get(robot_id, 0.0)
            self.publishers[robot_id].publish(message)

    def set(self, **values):
        with self.lock:
            for name, value in values.items():
                setattr(self, name, value)


def read_poses(swarm):
    """Return the poses of all robots; None while one is not fresh: on a busy machine they come late."""
    try:
        return swarm.poses
    except StaleDataError:
        return None


class LocalizationTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.log, cls.reports, cls.maps, cls.problems = [], [], [], {}
        rospy.Subscriber("/rosout", Log, lambda line: cls.log.append(line.msg))
        rospy.Subscriber("/diagnostics", DiagnosticArray, cls.receive_diagnostics)
        cls.capture = MotionCapture(0, 1)
        rospy.Subscriber("/map", OccupancyGrid, cls.maps.append)
        rospy.Subscriber("/localization/poses", RobotPoses, cls.reports.append)
        wait_for(lambda: cls.find(0, RobotPose.TRACKED) and cls.find(1, RobotPose.TRACKED), "poses of both robots")

    @classmethod
    def receive_diagnostics(cls, message):
        cls.problems.update({s.hardware_id: s.message for s in message.status if s.name.startswith("localization")})

    @classmethod
    def find(cls, robot_id, state):
        """Return the newest pose of a robot if it has this state."""
        robots = cls.reports[-1].robots if cls.reports else []
        return next((robot for robot in robots if robot.id == robot_id and robot.state == state), None)

    def is_at_truth(self, x_m, y_m, robot_id):
        place = self.capture.poses[robot_id].position
        return math.hypot(x_m - place.x, y_m - place.y) < TOLERANCE_M

    def wait_for_line(self, part):
        wait_for(lambda: [line for line in self.log if part in line], "a line %r" % part)

    def test_1_a_robot_that_has_driven_is_where_it_truly_is(self):
        with Robot(0) as robot:
            robot.forward(0.2)
            robot.turn(1.0)
        wait_for(lambda: self.is_at_truth(*self.newest(0), 0), lambda: "%s" % (self.newest(0),))
        message = rospy.wait_for_message("/hero_0/pose", PoseWithCovarianceStamped, 30.0)
        self.assertEqual(message.header.frame_id, "map")
        self.assertTrue(self.is_at_truth(message.pose.pose.position.x, message.pose.pose.position.y, 0))
        self.assertTrue(0.0 < message.pose.covariance[0] < 1e-4 and 0.0 < message.pose.covariance[35] < 1e-2)
        truth = yaw_of(self.capture.poses[0].orientation)
        self.assertLess(abs(math.remainder(yaw_of(message.pose.pose.orientation) - truth, math.tau)), 0.05)

    def newest(self, robot_id):
        robot = self.find(robot_id, RobotPose.TRACKED)
        return (robot.x, robot.y) if robot else (math.nan, math.nan)

    def test_2_programs_get_poses_and_drive_in_the_common_frame(self):
        with Swarm([0, 1]) as swarm:
            swarm.wait_until_ready(30.0)
            poses = wait_for(lambda: read_poses(swarm), "fresh poses of both robots")
            for robot_id, pose in nonempty(poses.items()):
                self.assertTrue(self.is_at_truth(pose.x_m, pose.y_m, robot_id), pose)
            with self.assertRaisesRegex(FrameError, "no transform from hero_1/odom to world"):
                swarm[1].pose_in("world", 0.0)
            goal = (poses[1].x_m - 0.05, poses[1].y_m + 0.03)
            swarm[1].go_to(*goal, frame="map")
            wait_for(lambda: self.is_at_truth(*goal, 1), lambda: "hero_1 at %s" % (goal,))
        with Robot(2) as robot, self.assertRaisesRegex(FrameError, "hero_2 has no pose in the frame map: .*its tag"):
            robot.wait_until_ready(30.0)
            robot.pose_in("map", 0.1)

    def test_3_a_robot_that_was_never_measured_is_named(self):
        wait_for(lambda: self.find(2, RobotPose.UNKNOWN), "hero_2 without a pose")
        self.assertTrue(math.isnan(self.find(2, RobotPose.UNKNOWN).x))
        wait_for(lambda: "never measured" in self.problems.get("hero_2", ""), lambda: self.problems)

    def test_4_a_covered_robot_is_lost_and_found_again(self):
        self.capture.set(covered={0})
        lost = wait_for(lambda: self.find(0, RobotPose.LOST), "hero_0 lost")
        self.assertTrue(self.is_at_truth(lost.x, lost.y, 0))
        self.wait_for_line("hero_0 lost: its pose follows its odometry")
        self.capture.set(covered=set())
        wait_for(lambda: self.find(0, RobotPose.TRACKED), "hero_0 tracked")
        self.wait_for_line("hero_0 found again")

    def test_5_the_pose_of_a_robot_moved_by_hand_is_reset(self):
        self.capture.set(shift_m={1: 0.4})
        self.wait_for_line("hero_1 was moved by hand: pose reset by 400 mm")
        wait_for(
            lambda: self.is_at_truth(self.newest(1)[0] - 0.4, self.newest(1)[1], 1), lambda: "%s" % (self.newest(1),)
        )
        self.capture.set(shift_m={})

    def test_6_the_robots_map_the_wall_that_they_see(self):
        with Robot(0) as robot:
            robot.turn(-math.pi / 2.0 - yaw_of(self.capture.poses[0].orientation))
            wall_m = self.capture.poses[0].position.y + 0.75
            robot.forward(wall_m - 0.12)
        wait_for(lambda: [row for row in self.list_occupied() if abs(row[1] + 0.75) < 0.02], self.list_occupied)
        frontiers = rospy.wait_for_message("/map_arena/frontiers", PoseArray, 30.0)
        self.assertEqual(frontiers.header.frame_id, "map")
        self.assertTrue(frontiers.poses)
        self.assertTrue(0.0 < rospy.wait_for_message("/map_arena/known_share", Float32, 30.0).data < 0.5)
        answer = rospy.ServiceProxy("/map_arena/save", Trigger)()
        self.assertTrue(answer.success, answer.message)
        saved = cv2.imread(answer.message.partition(" and ")[2], cv2.IMREAD_GRAYSCALE)
        self.assertTrue((saved == OCCUPIED).any(), "the wall")

    def list_occupied(self):
        """Return x, y of the occupied cells of /map."""
        if not self.maps:
            return []
        info, data = self.maps[-1].info, self.maps[-1].data
        cells = [index for index, percent in enumerate(data) if percent > 50]
        return [
            (
                info.origin.position.x + (index % info.width + 0.5) * info.resolution,
                info.origin.position.y + (index // info.width + 0.5) * info.resolution,
            )
            for index in cells
        ]

    def test_7_poses_in_another_frame_are_refused_with_a_remedy(self):
        self.capture.set(frame="mocap")
        self.wait_for_line("/hero_0/measured_pose is in the frame 'mocap', but must be in 'map': set ~pose_frame to it")
        self.capture.set(frame="map")

    def test_8_reports_of_a_tracker_in_another_frame_are_refused_with_a_remedy(self):
        report = RobotPoses()
        report.header.frame_id = "arena"
        rospy.Publisher("/track/measured_poses", RobotPoses, queue_size=1, latch=True).publish(report)
        self.wait_for_line(
            "/track/measured_poses is in the frame 'arena', but must be in 'map': give its publisher and this node"
        )


if __name__ == "__main__":
    rospy.init_node("test_localization")
    rostest.rosrun("hero_localization", "test_localization", LocalizationTest, sys.argv)
