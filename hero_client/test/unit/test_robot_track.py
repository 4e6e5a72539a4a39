"""Rate, distance and nearest obstacle of one robot, from what its topics said so far."""

import math

import pytest

from hero_client.fleet_state import Pose, RateMeter, RobotTrack, find_nearest, yaw_of_quaternion

EIGHTH = math.pi / 4


def test_a_rate_is_what_came_divided_by_the_time_it_took():
    meter = RateMeter()
    assert meter.rate_hz(0.0) == 0.0
    for tick in range(1, 11):
        for _ in range(15):
            meter.count()
        rate_hz = meter.rate_hz(tick * 0.5)
    assert rate_hz == pytest.approx(30.0)


def test_a_robot_that_falls_silent_is_at_zero_within_a_few_seconds():
    meter = RateMeter()
    for tick in range(10):
        meter.count()
        meter.rate_hz(tick * 0.5)
    for tick in range(10, 20):
        rate_hz = meter.rate_hz(tick * 0.5)
    assert rate_hz == 0.0


def test_the_way_adds_up_and_the_first_pose_is_no_way():
    track = RobotTrack()
    for pose in (Pose(5.0, 5.0, 3.0), Pose(5.3, 5.4, 3.0), Pose(5.0, 5.0, -3.0)):
        track.receive_pose(pose)
    assert track.way_m == pytest.approx(1.0)
    assert track.turned_rad == pytest.approx(math.tau - 6.0), "the short way round"


@pytest.mark.parametrize(
    ("index", "bearing_rad"), [(4, 0.0), (6, math.pi / 2), (2, -math.pi / 2), (5, EIGHTH), (0, -math.pi)]
)
def test_the_nearest_obstacle_has_the_bearing_of_its_beam(index, bearing_rad):
    ranges_m = [0.2] * 8
    ranges_m[index] = 0.1
    nearest = find_nearest(ranges_m, -math.pi, EIGHTH)
    assert nearest.range_m == 0.1
    assert math.remainder(nearest.bearing_rad - bearing_rad, math.tau) == pytest.approx(0.0)


def test_infinite_is_nothing_not_a_number_is_nothing_and_minus_infinite_is_nearest():
    assert find_nearest([math.inf] * 4 + [math.nan] * 4, -math.pi, EIGHTH) is None
    assert find_nearest([], -math.pi, EIGHTH) is None
    touching = [0.1, math.nan, -math.inf, 0.2, math.inf, math.inf, math.inf, math.inf]
    assert find_nearest(touching, -math.pi, EIGHTH).range_m == -math.inf


def test_yaw_of_a_quaternion():
    assert yaw_of_quaternion(0.0, 0.0, math.sin(1.0), math.cos(1.0)) == pytest.approx(2.0)


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf, 1e306])
def test_a_pose_that_cannot_be_shown_is_none_and_adds_no_way(number):
    track = RobotTrack()
    for pose in (Pose(0.0, 0.0, 0.0), Pose(number, 0.0, 0.0), Pose(0.0, number, 0.0), Pose(0.0, 0.0, number)):
        track.receive_pose(pose)
        assert track.way_m == 0.0
    track.receive_pose(Pose(math.nan, 0.0, 0.0))
    assert track.pose is None


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_ranges_at_angles_that_cannot_be_shown_are_not_seen(number):
    track = RobotTrack()
    for angle_min_rad, increment_rad in ((number, 0.8), (0.0, number)):
        track.receive_proximity([0.1], angle_min_rad, increment_rad)
        assert (track.proximity_seen, track.nearest) == (False, None)


def test_ranges_that_no_sensor_measures_are_no_obstacle():
    assert find_nearest([math.nan, 1e306, -1e306, math.inf], 0.0, 0.8) is None
