"""What is received of a robot becomes a rate, a distance and the nearest obstacle."""

import math
from types import SimpleNamespace

import pytest

from hero_client.ros.robot_listener import RateMeter, RobotTrack
from hero_client.values.readings import read_ranges
from hero_node.geometry import Pose


def test_a_rate_is_the_count_divided_by_the_time():
    meter = RateMeter()
    assert meter.rate_hz(0.0) == 0.0
    for tick in range(1, 11):
        meter.total += 15
        rate_hz = meter.rate_hz(tick * 0.5)
    assert rate_hz == pytest.approx(30.0)


def test_a_robot_that_falls_silent_is_at_zero_within_a_few_seconds():
    meter = RateMeter()
    for tick in range(10):
        meter.total += 1
        meter.rate_hz(tick * 0.5)
    for tick in range(10, 20):
        rate_hz = meter.rate_hz(tick * 0.5)
    assert rate_hz == 0.0


def test_a_rate_is_that_of_the_last_three_seconds():
    meter = RateMeter()
    rates_hz = []
    for tick in range(41):
        meter.total += 0 if tick < 20 else 5
        rates_hz.append(meter.rate_hz(0.5 * tick))
    assert rates_hz[19] == 0.0 and rates_hz[20] == pytest.approx(5.0 / 3.0)
    assert rates_hz[25] == pytest.approx(10.0) == rates_hz[40]
    assert RateMeter().rate_hz(1.0) == 0.0 and not RobotTrack().proximity_seen


def test_turns_add_up_the_short_way():
    track = RobotTrack()
    for yaw_rad in (0.5, 0.8, 0.7, 3.0, -3.0):
        track.receive_pose(Pose(0.0, 0.0, yaw_rad))
    assert track.turned_rad == pytest.approx(0.3 + 0.1 + 2.3 + math.tau - 6.0)


def test_distances_add_up_from_the_first_pose_on():
    track = RobotTrack()
    for pose in (Pose(5.0, 5.0, 3.0), Pose(5.3, 5.4, 3.0), Pose(5.0, 5.0, -3.0)):
        track.receive_pose(pose)
    assert track.distance_m == pytest.approx(1.0)
    assert track.turned_rad == pytest.approx(math.tau - 6.0), "the short way round"


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf, 1e306])
def test_an_implausible_pose_is_none_and_adds_no_distance(number):
    track = RobotTrack()
    for pose in (Pose(0.0, 0.0, 0.0), Pose(number, 0.0, 0.0), Pose(0.0, number, 0.0), Pose(0.0, 0.0, number)):
        track.receive_pose(pose)
        assert track.distance_m == 0.0
    track.receive_pose(Pose(math.nan, 0.0, 0.0))
    assert track.pose is None


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_ranges_at_invalid_angles_are_not_seen(number):
    track = RobotTrack()
    for angle_min_rad, increment_rad, is_seen in ((0.0, 0.8, True), (number, 0.8, False), (0.0, number, False)):
        scan = SimpleNamespace(ranges=[0.1], angle_min=angle_min_rad, angle_increment=increment_rad)
        track.receive_proximity(read_ranges(scan), angle_min_rad, increment_rad)
        assert track.proximity_seen == is_seen == (track.nearest is not None)
