"""Inputs from ROS: odometry of robots, and poses measured by motion capture, a camera or anything else."""

import math
import struct
from contextlib import suppress
from typing import Any, Callable, Optional, Tuple

import genpy
import numpy as np
import rospy
from geometry_msgs.msg import Point, PoseStamped, PoseWithCovarianceStamped
from geometry_msgs.msg import Pose as PoseMessage
from nav_msgs.msg import Odometry

from hero_client.values import is_plausible, read_pose
from hero_node import Pose
from hero_node.ros_messages import HEADER, LENGTH, POSE_FORM

from ..filter.pose_hypothesis import StampedPose
from .outputs import IN_PLANE

MAX_FIELD_M = 100.0
QUATERNION_TOLERANCE = 0.01
"""Error of the square of a quaternion's length, 1: as tf has it."""

MIN_UPRIGHT = 0.7
"""Part of the robot's axis that points up: 45 degrees."""

RISE_M, STILL_M = 0.15, 0.02
"""A robot that comes this far up or down, but not even the second along y, drives where y points up."""

POSE_TYPES = {kind._md5sum: kind for kind in (PoseStamped, PoseWithCovarianceStamped, Odometry)}
"""Types of measured poses, by md5; of an Odometry the pose counts."""


def subscribe_odometry(namespace: str, receive: Callable[[float, Pose], None]) -> None:
    """Call receive with stamp (s) and pose of each message on /hero_N/odom, on a thread of rospy.

    Nothing else is decoded: 29 messages come a second from each robot.
    """
    topic = namespace + "/odom"
    rospy.Subscriber(topic, rospy.AnyMsg, _receive_odometry, receive, queue_size=30, tcp_nodelay=True)


def _receive_odometry(message: rospy.AnyMsg, receive: Callable[[float, Pose], None]) -> None:
    if message._connection_header["md5sum"] != Odometry._md5sum:
        return
    with suppress(struct.error):
        stamp_s, pose = _read_odometry(message._buff)
        if pose is not None and is_plausible(pose) and math.isfinite(stamp_s):
            receive(stamp_s, pose)


def _read_odometry(data: bytes) -> Tuple[float, Optional[Pose]]:
    """Return stamp (s) and pose in the plane of a serialized nav_msgs/Odometry; no pose for an invalid quaternion.

    Raises: struct.error.
    """
    _, seconds, nanoseconds, frame_length = HEADER.unpack_from(data)
    offset = HEADER.size + frame_length
    offset += LENGTH.size + LENGTH.unpack_from(data, offset)[0]  # child_frame_id
    x_m, y_m, _, x, y, z, w = POSE_FORM.unpack_from(data, offset)
    if not is_rotation(x, y, z, w):
        return seconds + 1e-9 * nanoseconds, None
    yaw_rad = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return seconds + 1e-9 * nanoseconds, Pose(x_m, y_m, yaw_rad)


def is_rotation(x: float, y: float, z: float, w: float) -> bool:
    """Return whether a quaternion is one of a rotation: (0, 0, 0, 0), which was not filled in, is no heading."""
    return abs(x * x + y * y + z * z + w * w - 1.0) <= QUATERNION_TOLERANCE  # x**2 raises OverflowError


def describe_source(topic: str, message: Any) -> str:
    """Return the topic and node that a message came from."""
    return f"{topic} ({(message._connection_header or {}).get('callerid', 'unknown node')})"


def find_pose_mistake(pose: PoseMessage) -> str:
    """Return what is wrong with a geometry_msgs/Pose that no robot on the floor can have; empty if nothing is."""
    turn, place = pose.orientation, pose.position
    farthest_m = max(abs(place.x), abs(place.y))
    if MAX_FIELD_M < farthest_m < math.inf:
        return f"has a position of {farthest_m:.0f} m: does the motion capture system publish mm?"
    if not is_rotation(turn.x, turn.y, turn.z, turn.w):
        text = "has the orientation %g, %g, %g, %g, but a quaternion has the length 1: is it filled in?"
        return text % (turn.x, turn.y, turn.z, turn.w)
    if 1.0 - 2.0 * (turn.x**2 + turn.y**2) < MIN_UPRIGHT:
        return "holds a robot that lies on its side: is the up axis of the motion capture system z?"
    return ""


class PoseInput:
    """Subscription to poses of one robot that something measures: one of POSE_TYPES."""

    def __init__(
        self,
        topic: str,
        frame: str,
        default_covariance: np.ndarray,
        receive: Callable[[StampedPose], None],
        warn: Callable[[str], None],
    ) -> None:
        """receive: is given each pose; warn: a line on what cannot be used. Both on a thread of rospy.

        frame: what the poses must name, if they name one.
        default_covariance: (3, 3), of poses that come without one.
        """
        self._topic = topic
        self._frame = frame
        self._default_covariance = default_covariance
        self._receive = receive
        self._warn = warn
        self._start: Optional[Point] = None
        rospy.Subscriber(topic, rospy.AnyMsg, self._receive_message, queue_size=30, tcp_nodelay=True)

    def _rises(self, place: Point) -> bool:
        """Return whether the robot is higher or lower than where its y was last another one."""
        if self._start is None or not abs(place.y - self._start.y) <= STILL_M:
            self._start = place
        return abs(place.z - self._start.z) > RISE_M

    def _receive_message(self, message: rospy.AnyMsg) -> None:
        try:
            self._receive(self._read(message))
        except genpy.DeserializationError:
            return
        except ValueError as error:
            self._warn(f"{self._topic} {error}")

    def _read(self, message: rospy.AnyMsg) -> StampedPose:
        """Return the pose in a message. Raises: ValueError with what is wrong with it; genpy.DeserializationError."""
        kind = POSE_TYPES.get(message._connection_header["md5sum"])
        if kind is None:
            known = ", ".join(kind._type for kind in POSE_TYPES.values())
            found = message._connection_header.get("type", "?")
            raise ValueError(f"has the type {found}, but must have one of: {known}")
        content = kind().deserialize(message._buff)
        frame = content.header.frame_id.lstrip("/")
        if frame not in ("", self._frame):
            text = "is in the frame %r, but must be in %r: set ~pose_frame to it, or publish it there"
            raise ValueError(text % (frame, self._frame))
        has_covariance = kind is not PoseStamped
        message_pose = content.pose.pose if has_covariance else content.pose
        if self._rises(message_pose.position):
            text = "rises by more than %g m, but stays at one y: is the up axis of the motion capture system z?"
            raise ValueError(text % RISE_M)
        mistake = find_pose_mistake(message_pose)
        if mistake:
            raise ValueError(mistake)
        pose = read_pose(message_pose)
        if pose is None:
            raise ValueError("holds a pose that no robot can have: not finite, or beyond 1000 m")
        covariance = self._default_covariance
        if has_covariance:
            told = np.array(content.pose.covariance).reshape(6, 6)[IN_PLANE]
            covariance = told if told.any() else covariance  # may not be filled in
        # A stamp of zero says that the sender does not know the time: that of arrival is the best there is.
        stamp = content.header.stamp if content.header.stamp else rospy.get_rostime()
        return StampedPose(stamp.to_sec(), pose, covariance, describe_source(self._topic, message))
