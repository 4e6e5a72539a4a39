"""Poses of motion capture systems that are set up wrongly."""

import io
import math
import re

import pytest
import rospy
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion

from hero_localization.filter.pose_filter import make_covariance
from hero_localization.nodes import inputs
from hero_localization.nodes.inputs import PoseInput, find_pose_mistake

UPRIGHT = Quaternion(0.0, 0.0, math.sin(0.4), math.cos(0.4))


@pytest.mark.parametrize(
    ("pose", "mistake"),
    [
        (Pose(Point(1.2, -0.4, 0.08), UPRIGHT), ""),
        (Pose(Point(1.2, -0.4, 0.08), Quaternion(0.0, 0.0, 0.0, 0.0)), ""),
        (Pose(Point(1.2, -0.4, 0.08), Quaternion(2.0 * math.sin(0.35), 0.0, 0.0, 2.0 * math.cos(0.35))), ""),
        (Pose(Point(1213.0, -400.0, 80.0), UPRIGHT), "has a position of 1213 m: .* mm"),
        (Pose(Point(1.2, 0.08, 0.4), Quaternion(0.0, math.sin(0.6), 0.0, math.cos(0.6))), "lies on its side: .* z"),
    ],
)
def test_poses_in_millimeters_or_with_y_up_are_named(pose, mistake):
    found = find_pose_mistake(pose)
    assert re.search(mistake, found) and bool(mistake) == bool(found)


def receive(input_, x_m, y_m, z_m):
    pose = PoseStamped(pose=Pose(Point(x_m, y_m, z_m), UPRIGHT))
    pose.header.stamp = rospy.Time(100)
    buffer, message = io.BytesIO(), rospy.AnyMsg()
    pose.serialize(buffer)
    message._buff, message._connection_header = buffer.getvalue(), {"md5sum": PoseStamped._md5sum}
    input_._receive_message(message)


def test_a_robot_that_drives_where_y_points_up_is_named(monkeypatch):
    monkeypatch.setattr(inputs.rospy, "Subscriber", lambda *_, **__: None)
    used, lines = [], []
    input_ = PoseInput("/hero_0/pose", "map", make_covariance(0.002, 0.01), used.append, lines.append)
    for step in range(10):  # on a floor that is not quite level
        receive(input_, 0.1 * step, 0.05 * step, 0.08 + 0.04 * step)
    assert (len(used), lines) == (10, [])
    for step in range(10):
        receive(input_, 0.02 * step, 0.08, 0.1 * step)
    assert len(used) == 12 and len(lines) == 8
    assert "/hero_0/pose rises by more than 0.15 m, but stays at one y" in lines[0]
