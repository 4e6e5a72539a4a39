"""Outputs to ROS: poses of robots in the common frame, as messages and on tf, and diagnostics."""

import math
from typing import Dict, Sequence

import diagnostic_updater
import numpy as np
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseWithCovarianceStamped, Quaternion, TransformStamped
from tf2_msgs.msg import TFMessage

from hero_msgs.msg import RobotPose, RobotPoses
from hero_node.geometry import Pose

from ..filter.swarm_localizer import LocalizedRobot


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
                publisher.publish(self._make_message(robot))
        if transforms:
            self._tf.publish(TFMessage(transforms))

    def _make_transform(self, robot_id: int, stamp_s: float, origin: Pose) -> TransformStamped:
        transform = TransformStamped()
        transform.header.stamp = rospy.Time.from_sec(stamp_s)
        transform.header.frame_id = self._frame
        transform.child_frame_id = "hero_%d/odom" % robot_id
        transform.transform.translation.x = origin.x_m
        transform.transform.translation.y = origin.y_m
        transform.transform.rotation = _make_quaternion(origin.yaw_rad)
        return transform

    def _make_message(self, robot: LocalizedRobot) -> PoseWithCovarianceStamped:
        message = PoseWithCovarianceStamped()
        if robot.estimate is not None:
            stamp_s, pose, covariance = robot.estimate
            message.header.stamp, message.header.frame_id = rospy.Time.from_sec(stamp_s), self._frame
            message.pose.pose.position.x, message.pose.pose.position.y = pose.x_m, pose.y_m
            message.pose.pose.orientation = _make_quaternion(pose.yaw_rad)
            entries = [0.0] * 36
            for row, place in enumerate((0, 1, 5)):  # of x, y and rotation about z
                for column, other in enumerate((0, 1, 5)):
                    entries[6 * place + other] = float(covariance[row, column])
            message.pose.covariance = entries
        return message

    def publish_diagnostics(self, robots: Sequence[LocalizedRobot], more: Sequence[DiagnosticStatus] = ()) -> None:
        """Publish the state of each robot, and other statuses."""
        if not self._diagnostics.get_num_connections():
            return
        message = DiagnosticArray(status=list(more))
        message.header.stamp = rospy.get_rostime()
        for robot in robots:
            status = diagnostic_updater.DiagnosticStatusWrapper()
            status.name = name_status("hero_%d" % robot.robot_id)
            status.hardware_id = "hero_%d" % robot.robot_id
            level = DiagnosticStatus.WARN if robot.problem else DiagnosticStatus.OK
            status.summary(level, robot.problem or robot.state.name.lower())
            message.status.append(status)
        self._diagnostics.publish(message)


def name_status(part: str) -> str:
    """Return the name of a part's diagnostic status: that of this node, and the part."""
    return "%s: %s" % (rospy.get_name().strip("/"), part)


def make_robot_pose(robot_id: int, state: int, stamp: rospy.Time, pose: Pose, covariance: np.ndarray) -> RobotPose:
    """Return the message; covariance: of x, y and yaw, (3, 3), m and rad."""
    message = RobotPose(id=robot_id, state=state, stamp=stamp, x=pose.x_m, y=pose.y_m, yaw=pose.yaw_rad)
    message.position_sd = math.sqrt(max(0.0, float(covariance[0, 0] + covariance[1, 1]) / 2.0))
    message.yaw_sd = math.sqrt(max(0.0, float(covariance[2, 2])))
    return message


def _describe_robot(robot: LocalizedRobot) -> RobotPose:
    if robot.estimate is not None:
        stamp_s, pose, covariance = robot.estimate
        return make_robot_pose(robot.robot_id, int(robot.state), rospy.Time.from_sec(stamp_s), pose, covariance)
    message = RobotPose(id=robot.robot_id, state=int(robot.state))
    message.x = message.y = message.yaw = message.position_sd = message.yaw_sd = math.nan
    return message


def _make_quaternion(yaw_rad: float) -> Quaternion:
    return Quaternion(0.0, 0.0, math.sin(yaw_rad / 2.0), math.cos(yaw_rad / 2.0))
