"""Messages written as bytes are those that ROS reads, field by field."""

import importlib
import io
import math

import pytest

pytest.importorskip("rospy", reason="reads by the classes of ROS")
from hero_node.ros_messages import (
    LENGTH,
    MD5SUMS,
    TooLongError,
    encode_header,
    encode_odometry,
    encode_pose,
    encode_scan,
    encode_transforms,
    encode_turn_scan,
    encode_twist,
    find_messages,
)

STAMP = (12, 34)


def find_class(message_type):
    package, _, name = message_type.partition("/")
    return getattr(importlib.import_module(package + ".msg"), name)


def read(message_type, data):
    """Return a message, of which these are all bytes."""
    message, written = find_class(message_type)().deserialize(data), io.BytesIO()
    message.serialize(written)
    assert written.getvalue() == data
    return message


def read_header(header):
    return header.seq, (header.stamp.secs, header.stamp.nsecs), header.frame_id


def read_place(position, orientation):
    return [getattr(position, axis) for axis in "xyz"] + [getattr(orientation, axis) for axis in "xyzw"]


def turned(x_m, y_m, yaw_rad, z_m=0.0):
    return pytest.approx([x_m, y_m, z_m, 0.0, 0.0, math.sin(yaw_rad / 2.0), math.cos(yaw_rad / 2.0)])


@pytest.mark.parametrize("name", MD5SUMS)
def test_layouts_are_those_of_the_messages_that_are_installed(name):
    assert find_class(name)._md5sum == MD5SUMS[name]


@pytest.mark.parametrize(("seq", "shown"), [(0, 0), (5, 5), (-1, 2**32 - 1), (2**32 + 3, 3)])
def test_a_header_counts_modulo_the_size_of_its_number(seq, shown):
    header = read("std_msgs/Header", encode_header(seq, "höre", STAMP))
    assert header.seq == shown and (header.stamp.secs, header.stamp.nsecs) == STAMP
    assert header.frame_id == "höre"


def test_odometry_has_its_frames_pose_and_velocity():
    data = encode_odometry("hero_3/odom", "hero_3/base_link", STAMP, (1.0, 2.0, 0.5), (0.1, -0.7), 9)
    odometry = read("nav_msgs/Odometry", data)
    assert read_header(odometry.header) == (9, STAMP, "hero_3/odom") and odometry.child_frame_id == "hero_3/base_link"
    assert read_place(odometry.pose.pose.position, odometry.pose.pose.orientation) == turned(1.0, 2.0, 0.5)
    twist = odometry.twist.twist
    assert [getattr(twist.linear, axis) for axis in "xyz"] == [0.1, 0.0, 0.0]
    assert [getattr(twist.angular, axis) for axis in "xyz"] == [0.0, 0.0, -0.7]
    assert not any(odometry.pose.covariance) and not any(odometry.twist.covariance)
    again = encode_odometry("hero_3/odom", "hero_3/base_link", STAMP, (1.0, 2.0, 0.5), (0.1, -0.7))
    assert read("nav_msgs/Odometry", again).header.seq == 0


def test_every_transform_of_a_message_has_its_frames_and_place():
    poses = {"hero_3/hat_link": (1.0, 2.0, 0.5, 0.03), "hero_3/laser_link": (3.0, 4.0, -2.0)}
    transforms = [("hero_3/base_link", child, pose) for child, pose in poses.items()]
    message = read("tf2_msgs/TFMessage", encode_transforms(STAMP, transforms))
    assert [one.child_frame_id for one in message.transforms] == list(poses)
    for one in message.transforms:
        assert read_header(one.header) == (0, STAMP, "hero_3/base_link")
        assert read_place(one.transform.translation, one.transform.rotation) == turned(*poses[one.child_frame_id])


def test_a_pose_and_a_velocity_in_the_plane_are_those_of_ros():
    pose = read("geometry_msgs/Pose", encode_pose(1.0, 2.0, -3.0, 0.5))
    assert read_place(pose.position, pose.orientation) == turned(1.0, 2.0, -3.0, 0.5)
    twist = read("geometry_msgs/Twist", encode_twist(0.1, -0.2))
    assert (twist.linear.x, twist.angular.z) == (0.1, -0.2)


def test_a_scan_has_its_settings_ranges_and_intensities():
    header = encode_header(1, "hero_3/laser_link", STAMP)
    settings = (-1.0, 1.0, 0.5, 0.25, 0.2, 0.125, 4.0)
    scan = read("sensor_msgs/LaserScan", encode_scan(header, settings, (1.0, 2.0, 3.0), (5.0, 6.0)))
    names = "angle_min angle_max angle_increment time_increment scan_time range_min range_max".split()
    assert read_header(scan.header) == (1, STAMP, "hero_3/laser_link")
    assert [getattr(scan, name) for name in names] == pytest.approx(settings)
    assert (list(scan.ranges), list(scan.intensities)) == ([1.0, 2.0, 3.0], [5.0, 6.0])


def test_a_scan_of_a_whole_turn_begins_at_the_rear_and_ends_before_it():
    data = encode_turn_scan(encode_header(1, "a"), 0.2, (0.125, 4.0), [float(beam) for beam in range(8)], [1.0])
    scan = read("sensor_msgs/LaserScan", data)
    assert scan.angle_min == pytest.approx(-math.pi) and scan.angle_increment == pytest.approx(math.pi / 4.0)
    assert scan.angle_min + 7 * scan.angle_increment == pytest.approx(scan.angle_max)
    assert (scan.scan_time, scan.range_min, scan.range_max) == pytest.approx((0.2, 0.125, 4.0))
    assert scan.time_increment == 0.0 and len(scan.ranges) == 8 and list(scan.intensities) == [1.0]


def test_messages_of_a_stream_are_found_up_to_the_first_that_is_too_long():
    frames = [LENGTH.pack(length) + bytes(length) for length in (0, 3, 5)]
    stream = b"".join(frames)
    assert list(find_messages(stream, 5)) == [(4, 4), (8, 11), (15, 20)]
    for cut in (1, 5, 8):
        assert list(find_messages(stream[:-cut], 5)) == [(4, 4), (8, 11)]
    found = find_messages(stream, 4)
    assert [next(found), next(found)] == [(4, 4), (8, 11)]
    with pytest.raises(TooLongError, match="a message of 5 bytes; at most 4 are accepted"):
        next(found)
