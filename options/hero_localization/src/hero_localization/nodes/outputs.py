"""Outputs to ROS: poses of robots in the common frame, as messages and on tf, and diagnostics."""

import math
from typing import Dict, Iterable, List, Mapping, Sequence

import numpy as np
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseWithCovarianceStamped, Quaternion, TransformStamped
from tf2_msgs.msg import TFMessage

from hero_msgs.msg import RobotPose, RobotPoses
from hero_node import Pose

from ..filter.pose_hypothesis import StampedPose
from ..filter.swarm_localizer import LocalizedRobot

IN_PLANE = np.ix_((0, 1, 5), (0, 1, 5))
"""Indices in a covariance (x, y, z, and rotations about them) of x, y and yaw."""


class Outputs:
    """Publishers of one common frame: ~poses, /hero_N/pose, /tf and /diagnostics."""

    def __init__(self, frame: str) -> None:
        self._frame = frame
        self._poses = rospy.Publisher("~poses", RobotPoses, queue_size=2)
        self._tf = rospy.Publisher("/tf", TFMessage, queue_size=10)
        self._diagnostics = rospy.Publisher("/diagnostics", DiagnosticArray, queue_size=2)
        self._robots: Dict[int, rospy.Publisher] = {}
        self._stamps: Dict[int, float] = {}

    def add_robot(self, robot_id: int) -> None:
        """Advertise /hero_N/pose."""
        topic = "/hero_%d/pose" % robot_id
        self._robots[robot_id] = rospy.Publisher(topic, PoseWithCovarianceStamped, queue_size=2)

    def publish(self, robots: Sequence[LocalizedRobot]) -> None:
        """Publish where the robots are. A transform is sent once for each reading of odometry."""
        now = rospy.get_rostime()
        report = RobotPoses(robots=[_describe_robot(robot) for robot in robots])
        report.header.stamp, report.header.frame_id = now, self._frame
        self._poses.publish(report)
        transforms = []
        for robot in robots:
            if robot.estimate is None or robot.odom_origin is None:
                continue
            stamp_s = robot.estimate.stamp_s
            if self._stamps.get(robot.robot_id) == stamp_s:
                continue  # tf warns of transforms that come twice with one stamp
            self._stamps[robot.robot_id] = stamp_s
            transforms.append(self._make_transform(robot.robot_id, stamp_s, robot.odom_origin))
            publisher = self._robots[robot.robot_id]
            if publisher.get_num_connections():
                publisher.publish(self._make_message(robot.estimate))
        if transforms:
            self._tf.publish(TFMessage(transforms))

    def _make_transform(self, robot_id: int, stamp_s: float, origin: Pose) -> TransformStamped:
        transform = TransformStamped(child_frame_id="hero_%d/odom" % robot_id)
        transform.header.stamp, transform.header.frame_id = rospy.Time.from_sec(stamp_s), self._frame
        transform.transform.translation.x = origin.x_m
        transform.transform.translation.y = origin.y_m
        transform.transform.rotation = _make_quaternion(origin.yaw_rad)
        return transform

    def _make_message(self, estimate: StampedPose) -> PoseWithCovarianceStamped:
        stamp_s, pose, covariance = estimate[:3]
        message = PoseWithCovarianceStamped()
        message.header.stamp, message.header.frame_id = rospy.Time.from_sec(stamp_s), self._frame
        message.pose.pose.position.x, message.pose.pose.position.y = pose.x_m, pose.y_m
        message.pose.pose.orientation = _make_quaternion(pose.yaw_rad)
        entries = np.zeros((6, 6))
        entries[IN_PLANE] = covariance
        message.pose.covariance = entries.ravel().tolist()
        return message

    def publish_diagnostics(
        self, robots: Iterable[LocalizedRobot], unknown: Iterable[int], clocks: Mapping[str, str]
    ) -> None:
        """Publish the state of each robot, and warnings: tags of robots that no driver knows, clocks that are off."""
        text = "its tag is seen, but no driver knows the robot: is it on, and is tag %d its own?"
        statuses = [make_status("hero_%d" % robot_id, DiagnosticStatus.WARN, text % robot_id) for robot_id in unknown]
        statuses += [make_status(f"clock of {name}", DiagnosticStatus.WARN, clock) for name, clock in clocks.items()]
        for robot in robots:
            level = DiagnosticStatus.WARN if robot.problem else DiagnosticStatus.OK
            text = robot.problem or robot.state.name.lower()
            statuses.append(make_status("hero_%d" % robot.robot_id, level, text))
        publish_statuses(self._diagnostics, statuses)


def make_status(part: str, level: int, text: str) -> DiagnosticStatus:
    """Return the diagnostic status of a part of what this node works on, such as a robot."""
    return DiagnosticStatus(level, f"{rospy.get_name().strip('/')}: {part}", text, part, [])


def publish_statuses(publisher: rospy.Publisher, statuses: List[DiagnosticStatus]) -> None:
    """Publish statuses as a diagnostic_msgs/DiagnosticArray."""
    message = DiagnosticArray(status=statuses)
    message.header.stamp = rospy.get_rostime()
    publisher.publish(message)


def make_robot_pose(robot_id: int, state: int, stamp: rospy.Time, pose: Pose, covariance: np.ndarray) -> RobotPose:
    """Return the message; covariance: of x, y and yaw, (3, 3), m and rad."""
    message = RobotPose(id=robot_id, state=state, stamp=stamp, x=pose.x_m, y=pose.y_m, yaw=pose.yaw_rad)
    message.position_sd = math.sqrt(max(0.0, float(covariance[0, 0] + covariance[1, 1]) / 2.0))
    message.yaw_sd = math.sqrt(max(0.0, float(covariance[2, 2])))
    return message


def _describe_robot(robot: LocalizedRobot) -> RobotPose:
    if robot.estimate is not None:
        stamp_s, pose, covariance = robot.estimate[:3]
        return make_robot_pose(robot.robot_id, int(robot.state), rospy.Time.from_sec(stamp_s), pose, covariance)
    message = RobotPose(id=robot.robot_id, state=int(robot.state))
    message.x = message.y = message.yaw = message.position_sd = message.yaw_sd = math.nan
    return message


def _make_quaternion(yaw_rad: float) -> Quaternion:
    return Quaternion(0.0, 0.0, math.sin(yaw_rad / 2.0), math.cos(yaw_rad / 2.0))
