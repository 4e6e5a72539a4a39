"""Numbers that robots send are checked where they enter; ranges, poses and colors."""

import math
from types import SimpleNamespace

import pytest
from geometry_msgs.msg import Point, Quaternion
from geometry_msgs.msg import Pose as PoseMessage
from sensor_msgs.msg import LaserScan

from hero_client.values.colors import parse_color
from hero_client.values.readings import find_nearest, front_first, read_pose
from hero_node import Pose, invert_pose, transform_pose

INF = math.inf
EIGHTH_RAD = math.pi / 4


def make_scan(ranges):
    return SimpleNamespace(ranges=ranges, angle_min=-math.pi, angle_increment=math.tau / max(1, len(ranges)))


def make_pose(x_m, y_m, w=1.0):
    return PoseMessage(Point(x_m, y_m, 0.0), Quaternion(0.0, 0.0, 0.0, w))


def test_a_pose_is_read():
    assert read_pose(make_pose(-1.0, 2.0)) == (-1.0, 2.0, 0.0)
    turned = PoseMessage(Point(0.0, 0.0, 0.0), Quaternion(0.0, 0.0, math.sin(1.0), math.cos(1.0)))
    assert read_pose(turned).yaw_rad == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("x_m", "y_m", "w"),
    [(1e306, 0.0, 1.0), (0.0, -1e9, 1.0), (math.nan, 0.0, 1.0), (0.0, math.inf, 1.0), (0.0, 0.0, math.nan)],
)
def test_an_implausible_pose_is_none(x_m, y_m, w):
    assert read_pose(make_pose(x_m, y_m, w)) is None


def test_the_inverse_of_a_pose_leads_back_to_the_origin():
    pose = Pose(0.3, -0.2, 1.1)
    assert transform_pose(pose, invert_pose(pose)) == pytest.approx((0.0, 0.0, 0.0))


def test_invalid_ranges_become_nan():
    ranges = front_first(make_scan([INF, INF, INF, INF, 0.1, math.nan, 1e306, -0.5]))
    assert ranges[0] == 0.1 and ranges[4:] == [INF] * 4
    assert all(map(math.isnan, ranges[1:4]))


@pytest.mark.parametrize(
    "message",
    [
        LaserScan(ranges=[0.1] * 10000, angle_increment=EIGHTH_RAD),
        LaserScan(ranges=[0.1] * 8, angle_min=math.nan, angle_increment=EIGHTH_RAD),
        LaserScan(ranges=[0.1] * 8, angle_increment=math.inf),
        LaserScan(ranges=[0.1] * 8, angle_increment=math.nan),
        LaserScan(ranges=[0.1] * 8, angle_min=1.0, angle_increment=1e-320),
        LaserScan(ranges=[0.1] * 8, angle_min=1e38, angle_increment=EIGHTH_RAD),
    ],
)
def test_an_invalid_scan_has_no_ranges(message):
    assert front_first(message) == []


def test_ranges_begin_at_the_front_and_go_counter_clockwise():
    assert front_first(make_scan([0, 1, 2, 3, 4, 5, 6, 7])) == [4, 5, 6, 7, 0, 1, 2, 3]
    assert front_first(make_scan([])) == front_first(make_scan([0.1] * 7)) == front_first(make_scan([0.1] * 16)) == []


def test_too_close_is_zero_and_invalid_stays_invalid():
    ranges = front_first(make_scan([INF, INF, INF, INF, -INF, math.nan, INF, INF]))
    assert ranges[0] == 0.0 and math.isnan(ranges[1])


@pytest.mark.parametrize(
    ("index", "bearing_rad"), [(0, 0.0), (2, math.pi / 2), (6, -math.pi / 2), (1, EIGHTH_RAD), (4, -math.pi)]
)
def test_the_nearest_obstacle_has_the_bearing_of_its_beam(index, bearing_rad):
    ranges_m = [0.2] * 8
    ranges_m[index] = 0.1
    nearest = find_nearest(ranges_m)
    assert nearest.range_m == 0.1
    assert math.remainder(nearest.bearing_rad - bearing_rad, math.tau) == pytest.approx(0.0)


def test_only_ranges_within_reach_are_obstacles_and_touch_is_nearest():
    for ranges_m in ([], [INF] * 4 + [math.nan] * 4, [math.nan, 1e306, -1e306, INF]):
        assert find_nearest(ranges_m) is None
    touching = [0.1, math.nan, 0.0, 0.2, INF, INF, INF, INF]
    assert find_nearest(touching).range_m == 0.0


def test_a_scan_whose_beams_all_point_the_same_way_has_no_ranges():
    for increment_rad in (0.0, -EIGHTH_RAD):
        scan = SimpleNamespace(ranges=[0.1] * 8, angle_min=-math.pi, angle_increment=increment_rad)
        assert front_first(scan) == []


def test_colors_have_names_or_numbers():
    assert parse_color("red") == (1.0, 0.0, 0.0)
    assert parse_color([0.1, 0.2, 0.3]) == (0.1, 0.2, 0.3)
    for wrong in ("pink-ish", [1, 2], [0, 0, 1.5]):
        with pytest.raises(ValueError):
            parse_color(wrong)
