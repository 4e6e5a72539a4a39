#!/usr/bin/env python3
"""From the simulated camera to poses: calibrate_camera as people run it, then track and localize as launched.

The images pass through this test, which spoils them.
"""

import json
import math
import os
import shutil
import sys
import tempfile
import unittest

import cv2
import numpy as np
import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Point, PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from hero_localization.camera.camera_model import Intrinsics
from hero_localization.prints.tag_images import draw_tag
from hero_localization.simulated_camera.camera_node import list_references
from hero_localization.tracking import settings as camera_file
from hero_msgs.msg import ObjectPoses, RobotPose, RobotPoses
from hero_sim.world import build_default
from hero_test.processes import Program, find_program
from hero_test.waiting import wait_for

TOLERANCE_M = 0.01
ROBOTS = 2
CAMERA_FILE = {"decimate": 1, "objects": {1: "box"}, "tag_robots": {5: 1}}
"""The print on robot 1 stands for an object here; the tag that would be its own is nowhere."""

STARTED_TURN_RAD = 0.3
STOPPED_RAD_S = 0.01

SHIFT_PX = 12
"""20 mm on the floor."""


class Spoiler:
    """Hands the camera's images on, as /spoiled/image_raw/compressed, with what is wrong with them.

    Attributes:
        newest: the last image that came.
        change: what makes another image of each; None: there are no images.
    """

    def __init__(self):
        self.newest = None
        self.change = np.copy
        self.publisher = rospy.Publisher("/spoiled/image_raw/compressed", CompressedImage, queue_size=1)
        rospy.Subscriber("/camera/image_raw", Image, self.receive, queue_size=1, buff_size=2**20)

    def receive(self, image):
        self.newest = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width)
        change = self.change
        if change is not None:
            data = cv2.imencode(".jpg", change(self.newest), (cv2.IMWRITE_JPEG_QUALITY, 95))[1].tobytes()
            self.publisher.publish(CompressedImage(header=image.header, format="jpeg", data=data))


def add_tags(*ids):
    """Return a change that puts tags into the middle of the arena, where no robot is."""

    def change(gray):
        spoiled = gray.copy()
        for index, tag_id in enumerate(ids):
            tag = np.kron(np.pad(draw_tag("36h11", tag_id), 1, constant_values=255), np.ones((2, 2), np.uint8))
            top, left = len(gray) // 2 + 60 * (index + 1), gray.shape[1] // 2
            spoiled[top : top + len(tag), left : left + len(tag)] = np.clip(tag, 30, 220)
        return spoiled

    return change


class TrackTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        directory = tempfile.mkdtemp()
        cls.addClassCleanup(shutil.rmtree, directory)
        cls.path = os.path.join(directory, "camera.yaml")
        places = {tag.tag_id: [tag.x_m, tag.y_m, 0.0] for tag in list_references(build_default(ROBOTS))}
        camera_file.update(cls.path, {**CAMERA_FILE, "references": places})
        cls.true, cls.problems, cls.poses, cls.objects, cls.measured_ids = {}, {}, {}, {}, []
        cls.spoiler = Spoiler()
        for robot_id in range(ROBOTS):
            rospy.Subscriber("/hero_%d/ground_truth" % robot_id, Odometry, cls.receive_truth, robot_id)
        rospy.Subscriber("/diagnostics", DiagnosticArray, cls.receive_diagnostics)
        rospy.Subscriber("/localization/poses", RobotPoses, cls.receive_poses)
        rospy.Subscriber("/track/measured_poses", RobotPoses, cls.receive_measured)
        rospy.Subscriber("/track/objects", ObjectPoses, cls.receive_objects)
        wait_for(lambda: cls.spoiler.newest is not None, "an image")

    @classmethod
    def receive_truth(cls, message, robot_id):
        cls.true[robot_id] = message

    @classmethod
    def receive_diagnostics(cls, message):
        cls.problems.update({status.name: status.message for status in message.status})

    @classmethod
    def receive_poses(cls, report):
        cls.poses.update({robot.id: robot for robot in report.robots})

    @classmethod
    def receive_measured(cls, report):
        cls.measured_ids = [robot.id for robot in report.robots]

    @classmethod
    def receive_objects(cls, report):
        cls.objects.update({found.name: found for found in report.objects})

    def start_calibration(self, *options):
        program = Program(find_program("hero_localization", "calibrate_camera"), *options, "--file", self.path)
        self.addCleanup(program.close)
        return program

    def calibrate(self, *options):
        """Return exit status and output of calibrate_camera."""
        program = self.start_calibration(*options)
        return program.wait_end(180.0), program.text()

    def read_file(self):
        with open(self.path) as file:
            return file.read()

    def wait_for_state(self, robot_id, state):
        def read():
            robot = self.poses.get(robot_id)
            return robot is not None and robot.state == state

        wait_for(read, lambda: "%s, %s" % (self.poses, self.problems))

    def wait_at_truth(self, read, robot_id):
        """Wait until x, y by read() are where a robot truly is."""
        true = self.true[robot_id].pose.pose.position
        wait_for(
            lambda: read() is not None and math.hypot(read().x - true.x, read().y - true.y) < TOLERANCE_M,
            lambda: "%s at (%.3f, %.3f)" % (read(), true.x, true.y),
        )

    def wait_for_problem(self, name, part):
        """Wait until a new diagnostic status says this."""
        self.problems.clear()
        wait_for(lambda: part in self.problems.get(name, ""), lambda: "%r of %s in %s" % (part, name, self.problems))

    def test_1_the_arenas_calibration_ends_with_figures_a_verdict_and_a_file(self):
        info = rospy.wait_for_message("/camera/camera_info", CameraInfo, 60.0)
        lens = Intrinsics.from_camera_info(info.width, info.height, info.K, info.distortion_model, info.D)
        camera_file.update(self.path, camera_file.describe_lens(lens))
        status, text = self.calibrate("arena")
        self.assertEqual(status, 0, text)
        self.assertIn("the camera is 2.20 m above the floor", text)
        self.assertIn("good; written to " + self.path, text)

    def test_2_an_interrupted_calibration_stops_the_robot_and_keeps_the_file(self):
        content, start = self.read_file(), self.true[0].pose.pose.orientation

        def has_turned():
            now = self.true[0].pose.pose.orientation
            return abs(now.z * start.w - now.w * start.z) > math.sin(STARTED_TURN_RAD / 2.0)

        program = self.start_calibration("robots", "--robots", "1 0")
        wait_for(has_turned, program.text)
        self.assertIn("hero_1: tag 5 is not in the image, or too dark; the robot was not moved", program.text())
        self.assertEqual(program.end(), 1, program.text())
        self.assertIn("ended before the calibration was complete: the file is as it was", program.text())
        self.assertEqual(self.read_file(), content)
        wait_for(lambda: abs(self.true[0].twist.twist.angular.z) < STOPPED_RAD_S, lambda: self.true[0])

    def test_3_the_launch_file_brings_poses_and_objects(self):
        image = "image:=/spoiled/image_raw/compressed"
        launch = Program("roslaunch", "hero_localization", "camera.launch", "file:=" + self.path, image)
        self.addClassCleanup(launch.end)
        self.wait_for_state(0, RobotPose.TRACKED)
        self.wait_at_truth(lambda: self.poses[0], 0)
        self.wait_at_truth(lambda: self.objects.get("box"), 1)
        message = rospy.wait_for_message("/hero_0/pose", PoseWithCovarianceStamped, 60.0)
        self.assertEqual(message.header.frame_id, "map")
        self.wait_at_truth(lambda: message.pose.pose.position, 0)

    def test_4_diagnostics_name_the_camera_and_the_robot_without_a_tag(self):
        wait_for(lambda: "images per second" in self.problems.get("track: camera", ""), lambda: self.problems)
        wait_for(lambda: "never measured" in self.problems.get("localization: hero_1", ""), lambda: self.problems)

    def test_5_what_was_found_is_shown_in_a_picture(self):
        picture = rospy.wait_for_message("/track/picture/compressed", CompressedImage, 60.0)
        self.assertTrue(picture.data.startswith(b"\xff\xd8"), picture.format)

    def test_6_a_robot_below_a_hand_is_lost_and_found_where_it_is(self):
        hand = rospy.Publisher("/camera/hand", Point, queue_size=1, latch=True)
        hand.publish(self.true[0].pose.pose.position)
        wait_for(lambda: 0 not in self.measured_ids, lambda: self.measured_ids)
        # What was said before the hand came does not count: a slow machine may have lost the robot for a moment.
        self.poses.clear()
        self.problems.clear()
        self.wait_for_state(0, RobotPose.LOST)
        wait_for(lambda: "occluded" in self.problems.get("localization: hero_0", ""), lambda: self.problems)
        hand.publish(Point(math.nan, math.nan, 0.0))
        wait_for(lambda: 0 in self.measured_ids, lambda: self.measured_ids)
        self.poses.clear()
        self.wait_for_state(0, RobotPose.TRACKED)
        self.wait_at_truth(lambda: self.poses[0], 0)

    def test_7_wrong_tags_bad_light_and_a_moved_camera_are_named(self):
        self.spoiler.change = add_tags(0, 77)
        self.wait_for_problem("track: tag 0", "appears more than once in the image and is ignored")
        self.wait_for_problem("localization: hero_77", "its tag is seen, but no driver knows the robot")
        self.spoiler.change = lambda gray: gray // 8
        self.wait_for_problem("track: camera", "images are too dark")
        self.spoiler.change = lambda gray: np.roll(gray, SHIFT_PX, axis=1)
        self.wait_for_problem("track: camera", "the camera moved; calibrate the arena again")

    def test_8_a_camera_that_stops_is_named(self):
        self.spoiler.change = None
        self.wait_for_problem("track: camera", "no image for")
        self.wait_for_problem("localization: hero_0", "is its tag occluded")

    def test_9_a_second_camera_is_enough_and_check_reads_both(self):
        names = ("__name:=track_2", "~measured_poses:=/track/measured_poses")
        options = ("_image:=camera/image_raw", "_file:=" + self.path)
        program = Program(find_program("hero_localization", "track"), *names, *options)
        self.addCleanup(program.close)
        self.wait_for_state(0, RobotPose.TRACKED)
        self.wait_at_truth(lambda: self.poses[0], 0)
        wait_for(lambda: "images per second" in self.problems.get("track_2: camera", ""), lambda: self.problems)
        check = Program(find_program("hero_tools", "check"), "--json")
        self.addCleanup(check.close)
        check.wait_end()
        point = next(point for point in json.loads(check.text())["points"] if point["point"] == "diagnostics")
        self.assertEqual(point["state"], "WARN")
        self.assertIn("track: 0 of 1 without a problem; track_2: 1 of 1 without a problem", point["text"])
        self.assertIn("track: camera: no image for", "; ".join(point["remedy"]))


if __name__ == "__main__":
    rospy.init_node("test_track")
    rostest.rosrun("hero_localization", "test_track", TrackTest, sys.argv)
