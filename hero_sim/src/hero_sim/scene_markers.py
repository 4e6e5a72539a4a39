"""Shapes of the simulated world as ROS markers, for RViz and the monitor's map."""

import math
from typing import Any, Iterable

from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from .scene import FRAME, Shape


def rotate_about_z(angle_rad: float) -> Quaternion:
    """Return the rotation by an angle about z."""
    return Quaternion(0.0, 0.0, math.sin(angle_rad / 2.0), math.cos(angle_rad / 2.0))


def make_markers(shapes: Iterable[Shape], stamp: Any = None) -> MarkerArray:
    """Return shapes as the message; stamp: a rospy.Time, None for 0."""
    return MarkerArray([_make_marker(shape, stamp) for shape in shapes])


def _make_marker(shape: Shape, stamp: Any) -> Marker:
    marker = Marker(ns=shape.namespace, id=shape.number, type=shape.kind, action=Marker.ADD, text=shape.text)
    marker.header.frame_id = FRAME
    if stamp is not None:
        marker.header.stamp = stamp
    marker.pose = Pose(Point(shape.pose.x_m, shape.pose.y_m, shape.z_m), rotate_about_z(shape.pose.yaw_rad))
    marker.scale = Vector3(*shape.size_m)
    marker.color = ColorRGBA(*shape.color)
    return marker
