"""Numbers that robots send are checked where they enter."""

import math

import pytest
from geometry_msgs.msg import Point, Quaternion
from geometry_msgs.msg import Pose as PoseMessage
from sensor_msgs.msg import LaserScan

from hero_client.robot_listener import MAX_RANGES, read_pose, read_ranges


def make_pose(x_m, y_m, w=1.0):
    return PoseMessage(Point(x_m, y_m, 0.0), Quaternion(0.0, 0.0, 0.0, w))


def test_a_pose_is_read():
    assert read_pose(make_pose(-1.0, 2.0)) == (-1.0, 2.0, 0.0)


@pytest.mark.parametrize(
    ("x_m", "y_m", "w"),
    [(1e306, 0.0, 1.0), (0.0, -1e9, 1.0), (math.nan, 0.0, 1.0), (0.0, math.inf, 1.0), (0.0, 0.0, math.nan)],
)
def test_a_pose_that_no_robot_can_have_is_none(x_m, y_m, w):
    assert read_pose(make_pose(x_m, y_m, w)) is None


def test_ranges_that_are_no_distances_say_nothing():
    ranges = read_ranges(LaserScan(ranges=[0.1, math.inf, -math.inf, math.nan, 1e306, -0.5]))
    assert ranges[:3] == [0.1, math.inf, -math.inf]
    assert all(map(math.isnan, ranges[3:]))


@pytest.mark.parametrize(
    "message",
    [
        LaserScan(ranges=[0.1] * (MAX_RANGES + 1)),
        LaserScan(ranges=[0.1], angle_min=math.nan),
        LaserScan(ranges=[0.1], angle_increment=math.inf),
    ],
)
def test_a_scan_that_no_robot_can_make_has_no_ranges(message):
    assert list(read_ranges(message)) == []
