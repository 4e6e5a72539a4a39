"""Poses, velocities and angles in the plane, in m, rad and s (REP 103). Pure."""

import math
from typing import Any, NamedTuple


class Pose(NamedTuple):
    """A position and a heading in the plane; the frame is that of its source."""

    x_m: float
    y_m: float
    yaw_rad: float
    """Counter-clockwise from the x axis of the frame."""

    def __repr__(self) -> str:
        """Return the pose to a millimeter and a milliradian."""
        return "Pose(x_m=%.3f, y_m=%.3f, yaw_rad=%.3f)" % self


class Velocity(NamedTuple):
    """Velocity of a robot, measured or commanded, in its frame hero_N/base_link."""

    linear_m_s: float
    """Positive forward."""
    angular_rad_s: float
    """Positive to the left."""

    def __repr__(self) -> str:
        """Return the velocity to a millimeter and a milliradian per second."""
        return "Velocity(linear_m_s=%.3f, angular_rad_s=%.3f)" % self


STOP = Velocity(0.0, 0.0)


def transform_pose(origin: Pose, pose: Pose) -> Pose:
    """Return pose in the frame of origin; pose is given in a frame whose origin is at origin."""
    cos, sin = math.cos(origin.yaw_rad), math.sin(origin.yaw_rad)
    return Pose(
        origin.x_m + cos * pose.x_m - sin * pose.y_m,
        origin.y_m + sin * pose.x_m + cos * pose.y_m,
        wrap_angle(origin.yaw_rad + pose.yaw_rad),
    )


def invert_pose(pose: Pose) -> Pose:
    """Return the pose of the frame's origin as seen from pose."""
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    return Pose(-cos * pose.x_m - sin * pose.y_m, sin * pose.x_m - cos * pose.y_m, -pose.yaw_rad)


def find_frame(pose: Pose, seen: Pose) -> Pose:
    """Return where a frame lies in which something at pose is seen at seen."""
    return transform_pose(pose, invert_pose(seen))


def measure_distance(start: Pose, end: Pose) -> float:
    """Return the distance between two places, m."""
    return math.hypot(end.x_m - start.x_m, end.y_m - start.y_m)


def wrap_angle(angle_rad: float) -> float:
    """Return the same direction within -pi..pi."""
    return math.remainder(angle_rad, math.tau)


def clamp(value: float, limit: float) -> float:
    """Return value cut to -limit..limit."""
    return max(-limit, min(limit, value))


def yaw_of(orientation: Any) -> float:
    """Return the turn about z, -pi..pi rad, of a geometry_msgs/Quaternion; nan for entries that are not finite."""
    x, y, z, w = orientation.x, orientation.y, orientation.z, orientation.w
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def pose_of(place: Any, turn: Any) -> Pose:
    """Return the pose in the plane of a geometry_msgs/Point or Vector3, and a Quaternion."""
    return Pose(place.x, place.y, yaw_of(turn))
