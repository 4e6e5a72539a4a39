"""Outputs to ROS: poses of robots in the common frame, as messages and on tf, and diagnostics."""

import math
from typing import Dict, Iterable, List, Mapping, Sequence

import numpy as np
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs import msg as geometry
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from hero_msgs.msg import RobotPose, RobotPoses
from hero_node import find_frame

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
        self._robots[robot_id] = rospy.Publisher(topic, geometry.PoseWithCovarianceStamped, queue_size=2)

    def publish(self, robots: Sequence[LocalizedRobot]) -> None:
        """Publish where the robots are. A transform is sent once for each reading of odometry."""
        report = RobotPoses(robots=[describe_robot(robot) for robot in robots])
        report.header.stamp, report.header.frame_id = rospy.get_rostime(), self._frame
        self._poses.publish(report)
        transforms, is_heard = [], self._tf.get_num_connections() > 0
        for robot, described in zip(robots, report.robots):
            if robot.estimate is None or self._stamps.get(robot.robot_id) == robot.estimate.stamp_s:
                continue  # tf warns of transforms that come twice with one stamp
            self._stamps[robot.robot_id] = robot.estimate.stamp_s
            header = Header(0, described.stamp, self._frame)
            if is_heard:
                x_m, y_m, yaw_rad = find_frame(robot.estimate.pose, robot.odometry)
                transform = geometry.Transform(geometry.Vector3(x_m, y_m, 0.0), _make_quaternion(yaw_rad))
                transforms.append(geometry.TransformStamped(header, "hero_%d/odom" % robot.robot_id, transform))
            publisher = self._robots[robot.robot_id]
            if publisher.get_num_connections():
                (x_m, y_m, yaw_rad), entries = robot.estimate.pose, np.zeros((6, 6))
                entries[IN_PLANE] = robot.estimate.covariance
                pose = geometry.Pose(geometry.Point(x_m, y_m, 0.0), _make_quaternion(yaw_rad))
                message = geometry.PoseWithCovariance(pose, entries.ravel().tolist())
                publisher.publish(geometry.PoseWithCovarianceStamped(header, message))
        if transforms:
            self._tf.publish(TFMessage(transforms))

    def publish_diagnostics(
        self, robots: Iterable[LocalizedRobot], unknown: Iterable[int], sources: Mapping[str, str]
    ) -> None:
        """Publish the state of each robot, and warnings: tags of robots that no driver knows, problems of sources."""
        text = "its tag is seen, but no driver knows the robot: is it on, and is tag %d its own?"
        statuses = [make_status("hero_%d" % robot_id, DiagnosticStatus.WARN, text % robot_id) for robot_id in unknown]
        statuses += [make_status(name, DiagnosticStatus.WARN, text) for name, text in sources.items()]
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


def describe_robot(robot: LocalizedRobot) -> RobotPose:
    """Return the message; of a robot without an estimate, all numbers are nan."""
    if robot.estimate is None:
        return RobotPose(robot.robot_id, int(robot.state), rospy.Time(), *[math.nan] * 5)
    stamp_s, pose, covariance = robot.estimate[:3]
    variances = ((covariance.item(0) + covariance.item(4)) / 2.0, covariance.item(8))
    sds = [math.sqrt(max(0.0, variance)) for variance in variances]
    return RobotPose(robot.robot_id, int(robot.state), rospy.Time.from_sec(stamp_s), *pose, *sds)


def _make_quaternion(yaw_rad: float) -> geometry.Quaternion:
    return geometry.Quaternion(0.0, 0.0, math.sin(yaw_rad / 2.0), math.cos(yaw_rad / 2.0))
