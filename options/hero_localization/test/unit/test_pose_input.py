"""Poses of motion capture systems that are set up wrongly."""

import io
import math
import re

import pytest
import rospy
from geometry_msgs.msg import Point, Pose, PoseStamped, PoseWithCovarianceStamped, Quaternion
from nav_msgs.msg import Odometry

from hero_localization.filter.pose_filter import make_covariance
from hero_localization.nodes import inputs
from hero_localization.nodes.inputs import PoseInput, find_pose_mistake

UPRIGHT = Quaternion(0.0, 0.0, math.sin(0.4), math.cos(0.4))


@pytest.mark.parametrize(
    ("pose", "mistake"),
    [
        (Pose(Point(1.2, -0.4, 0.08), UPRIGHT), ""),
        (Pose(Point(1.2, -0.4, 0.08), Quaternion(math.sin(0.35), 0.0, 0.0, math.cos(0.35))), ""),
        (Pose(Point(1.2, -0.4, 0.08), Quaternion(0.0, 0.0, 0.0, 0.0)), "orientation 0, 0, 0, 0, but .* filled in"),
        (Pose(Point(1.2, -0.4, 0.08), Quaternion(0.0, 0.0, 0.0, 0.99)), "orientation 0, 0, 0, 0.99"),
        (Pose(Point(1.2, -0.4, 0.08), Quaternion(0.0, 0.0, 1e300, 1e300)), r"orientation 0, 0, 1e\+300, 1e\+300"),
        (Pose(Point(1.2, -0.4, 0.08), Quaternion(0.0, 0.0, math.nan, 1.0)), "orientation 0, 0, nan, 1"),
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


@pytest.mark.parametrize(("degrees", "is_upright"), [(44.0, True), (46.0, False)])
def test_a_robot_tilted_by_45_degrees_lies_on_its_side(degrees, is_upright):
    half_rad = math.radians(degrees) / 2.0
    for direction_rad in (0.0, 0.7, 1.6, 3.5, 5.0):
        for scale in (0.997, 1.0, 1.003):
            tilt = scale * math.sin(half_rad)
            axis = tilt * math.cos(direction_rad), tilt * math.sin(direction_rad)
            turn = Quaternion(*axis, 0.0, scale * math.cos(half_rad))
            assert bool(find_pose_mistake(Pose(Point(0.0, 0.0, 0.0), turn))) != is_upright, (direction_rad, scale)
            spun = Quaternion(*axis, scale * math.cos(half_rad), 0.0)
            assert bool(find_pose_mistake(Pose(Point(0.0, 0.0, 0.0), spun))) != is_upright


def test_a_field_of_100_meters_is_in_meters():
    for x_m, y_m, is_named in ((99.0, 0.0, False), (-101.0, 3.0, True), (0.0, 101.0, True), (0.0, math.inf, False)):
        assert bool(find_pose_mistake(Pose(Point(x_m, y_m, 0.0), UPRIGHT))) == is_named, (x_m, y_m)


def make_raw(content):
    buffer, message = io.BytesIO(), rospy.AnyMsg()
    content.serialize(buffer)
    message._buff = buffer.getvalue()
    message._connection_header = {"md5sum": content._md5sum, "type": content._type}
    return message


@pytest.fixture
def pose_input(monkeypatch):
    """Return an input whose poses and warnings are kept."""
    monkeypatch.setattr(inputs.rospy, "Subscriber", lambda *_, **__: None)
    monkeypatch.setattr(inputs.rospy, "get_rostime", lambda: rospy.Time(77))
    used, lines = [], []
    made = PoseInput("/hero_0/pose", "map", make_covariance(0.002, 0.01), used.append, lines.append)
    made.used, made.lines = used, lines
    return made


def test_each_type_of_pose_is_read_with_its_covariance(pose_input):
    upright = Pose(Point(0.4, -0.2, 0.0), UPRIGHT)
    plain, odometry = PoseStamped(pose=upright), Odometry()
    plain.header.stamp, plain.header.frame_id = rospy.Time(5, 250000000), "/map"
    odometry.pose.pose = upright
    covariant = PoseWithCovarianceStamped()
    covariant.pose.pose, covariant.pose.covariance = upright, list(map(float, range(36)))
    for message in (plain, odometry, covariant):
        pose_input._receive_message(make_raw(message))
    assert pose_input.lines == [] and [used.stamp_s for used in pose_input.used] == [5.25, 77.0, 77.0]
    assert all(used.pose == pytest.approx((0.4, -0.2, 0.8)) for used in pose_input.used)
    default = make_covariance(0.002, 0.01).tolist()
    expected = [[0.0, 1.0, 5.0], [6.0, 7.0, 11.0], [30.0, 31.0, 35.0]]
    assert [used.covariance.tolist() for used in pose_input.used] == [default, default, expected]


def test_what_is_no_pose_in_the_frame_is_named_and_not_used(pose_input):
    pose_input._receive_message(make_raw(Point()))
    assert pose_input.lines.pop().startswith("/hero_0/pose has the type geometry_msgs/Point, but must have one of: ")
    other = PoseStamped(pose=Pose(Point(0.0, 0.0, 0.0), UPRIGHT))
    other.header.frame_id = "vicon"
    pose_input._receive_message(make_raw(other))
    assert pose_input.lines.pop().startswith("/hero_0/pose is in the frame 'vicon', but must be in 'map'")
    for place, words in (
        (Point(500.0, 0.0, 0.0), "500 m"), (Point(math.nan, 0.0, 0.0), "not finite, or beyond 1000 m"),
    ):  # fmt: skip
        pose_input._receive_message(make_raw(PoseStamped(pose=Pose(place, UPRIGHT))))
        assert words in pose_input.lines.pop()
    broken = make_raw(other)
    broken._buff = broken._buff[:20]
    pose_input._receive_message(broken)
    assert pose_input.lines == [] == pose_input.used


def test_poses_name_topic_and_node_that_they_came_from(pose_input):
    raw = make_raw(PoseStamped(pose=Pose(Point(0.0, 0.0, 0.0), UPRIGHT)))
    pose_input._receive_message(raw)
    raw._connection_header["callerid"] = "/vrpn"
    pose_input._receive_message(raw)
    assert [used.source for used in pose_input.used] == ["/hero_0/pose (unknown node)", "/hero_0/pose (/vrpn)"]


def test_a_pose_that_the_filter_refuses_is_named(pose_input):
    def refuse(measurement):
        raise ValueError("holds a covariance that is not positive definite")

    pose_input._receive = refuse
    pose_input._receive_message(make_raw(PoseStamped(pose=Pose(Point(0.0, 0.0, 0.0), UPRIGHT))))
    assert pose_input.lines == ["/hero_0/pose holds a covariance that is not positive definite"]


def test_odometry_is_read_from_its_bytes(monkeypatch):
    subscribed, used = [], []
    monkeypatch.setattr(inputs.rospy, "Subscriber", lambda *given, **_: subscribed.append(given))
    inputs.subscribe_odometry("/hero_0", lambda *given: used.append(given))
    ((topic, _, receive_message, receive),) = subscribed
    assert topic == "/hero_0/odom"
    message = Odometry(child_frame_id="hero_0/base_link")
    message.header.stamp, message.header.frame_id = rospy.Time(5, 250000000), "hero_0/odom"
    message.pose.pose = Pose(Point(0.4, -0.2, 0.1), Quaternion(0.1, 0.2, 0.3, math.sqrt(0.86)))
    receive_message(make_raw(message), receive)
    yaw_rad = math.atan2(2.0 * (math.sqrt(0.86) * 0.3 + 0.1 * 0.2), 1.0 - 2.0 * (0.2 * 0.2 + 0.3 * 0.3))
    ((stamp_s, pose),) = used
    assert stamp_s == pytest.approx(5.25) and pose == pytest.approx((0.4, -0.2, yaw_rad))
    message.pose.pose.orientation.w = 1e300
    turned = make_raw(message)
    message.pose.pose.position.x = math.nan
    for raw in (make_raw(message), make_raw(PoseStamped()), turned):
        receive_message(raw, receive)
    cut = make_raw(message)
    cut._buff = cut._buff[:30]
    receive_message(cut, receive)
    assert len(used) == 1
