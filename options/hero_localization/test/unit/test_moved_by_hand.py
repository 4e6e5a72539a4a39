"""Robots moved by hand, or found at a wrong place, at any rate of measured poses: drawn cameras, in virtual time."""

import math

import numpy as np
import pytest

from hero_localization.filter.pose_filter import MOVED_S, Outcome, PoseFilter, make_covariance
from hero_localization.filter.pose_hypothesis import StampedPose
from hero_node import Pose, measure_distance
from hero_test.nonempty import nonempty

RATES_HZ = (5.0, 10.0, 29.0, 31.0, 60.0, 100.0, 120.0, 240.0)
CAMERAS = (*((rate_hz,) for rate_hz in RATES_HZ), (30.0, 30.0), (30.0, 29.7), (60.0, 100.0))
"""Rates of cameras that see the robot."""
DRAWS = 4
COVARIANCE = make_covariance(0.0008, 0.004)
ODOMETRY_S = 0.034


def draw_images(random, rate_hz, end_s, dropped):
    """Return arrival and capture times, in the order of capture."""
    delay_s, first_s = random.uniform(0.005, 0.12), random.uniform(0.0, 1.0 / rate_hz)
    taken_s = np.arange(first_s, end_s, 1.0 / rate_hz)
    taken_s = taken_s[random.uniform(size=len(taken_s)) >= dropped]
    return list(zip(taken_s + delay_s + random.uniform(0.0, 0.003, len(taken_s)), taken_s))


def follow(seed, rates_hz, locate, end_s, dropped=0.1, false=0.0):
    """Yield a filter at rest with arrival time and outcome of each measured pose; locate(time): where it is."""
    random, pose_filter = np.random.RandomState(seed), PoseFilter()
    readings_s = np.arange(random.uniform(0.0, ODOMETRY_S), end_s, ODOMETRY_S)
    events = [(stamp_s + random.uniform(0.003, 0.02), 0, stamp_s) for stamp_s in readings_s]
    for rate_hz in rates_hz:
        events += [(arrival_s, 1, taken_s) for arrival_s, taken_s in draw_images(random, rate_hz, end_s, dropped)]
    for now_s, kind, stamp_s in sorted(events):
        if kind == 0:
            outcomes = [entry[2] for entry in pose_filter.add_odometry(stamp_s, Pose(0.0, 0.0, 0.0))]
        else:
            x_m, y_m, yaw_rad = random.normal(locate(stamp_s), (0.0003, 0.0003, 0.003))
            if random.uniform() < false:
                x_m, y_m = random.uniform(-2.0, 2.0, 2)
            outcomes = [pose_filter.add_measurement(StampedPose(stamp_s, Pose(x_m, y_m, yaw_rad), COVARIANCE))]
        for outcome in outcomes:
            yield now_s, pose_filter, outcome


def find_again_s(seed, rates_hz, locate, since_s, **errors):
    """Return how long after since_s the robot is known where it is, to 5 mm; None if not within 5 s."""
    for now_s, pose_filter, _ in follow(seed, rates_hz, locate, since_s + 5.0, **errors):
        pose = pose_filter.pose()
        if now_s > since_s and pose is not None and measure_distance(pose, Pose(*locate(now_s))) < 0.005:
            return now_s - since_s
    return None


@pytest.mark.parametrize("rates_hz", CAMERAS)
def test_a_robot_moved_by_hand_is_found_again_at_any_rate(rates_hz):
    def carry(now_s):
        return 0.5 * min(1.0, max(0.0, now_s - 1.0)), -0.2, 0.3

    for seed in range(DRAWS):
        # Four of ten poses are wanted at the least, and then the delay.
        limit_s = max(MOVED_S, 10.0 / sum(rates_hz)) + 0.25
        found_s = find_again_s(seed, rates_hz, carry, since_s=2.0)
        assert found_s is not None and found_s < limit_s, seed


@pytest.mark.parametrize("rate_hz", [30.0, 60.0, 240.0])
def test_false_detections_and_dropped_images_only_delay_it(rate_hz):
    for seed in range(DRAWS):
        found_s = find_again_s(
            seed, (rate_hz,), lambda now_s: (0.5 * (now_s > 1.0), 0.1, 0.0), since_s=1.0, dropped=0.5, false=0.2
        )
        assert found_s is not None and found_s < 2.0, seed


@pytest.mark.parametrize("rates_hz", [(5.0,), (30.0,), (60.0,), (240.0,), (30.0, 30.0)])
def test_a_false_start_is_corrected(rates_hz):
    for seed in range(DRAWS):
        first_s = next(now_s for now_s, _, outcome in follow(seed, rates_hz, lambda now_s: (9.0, 0.0, 0.0), 2.0))

        def locate(now_s, at_s=first_s):
            return (0.4 if now_s > at_s else 0.9), 0.2, -1.0

        found_s = find_again_s(seed, rates_hz, locate, since_s=first_s)
        assert found_s is not None and found_s < max(MOVED_S, 10.0 / sum(rates_hz)) + 0.25, seed


@pytest.mark.parametrize("rates_hz", CAMERAS)
def test_outliers_of_single_images_move_no_robot(rates_hz):
    for seed in range(DRAWS):
        for now_s, pose_filter, outcome in nonempty(follow(seed, rates_hz, lambda _: (0.4, 0.2, -1.0), 3.0, false=0.1)):
            if now_s > 1.5:  # the first pose may be false, too
                assert outcome is not Outcome.MOVED, seed
                assert measure_distance(pose_filter.pose(), Pose(0.4, 0.2, -1.0)) < 0.003, seed


def test_wrong_poses_at_240_hz_that_disagree_move_no_robot():
    random = np.random.RandomState(0)
    pose_filter = PoseFilter()
    pose_filter.add_odometry(1.0, Pose(0.0, 0.0, 0.0))
    pose_filter.add_measurement(StampedPose(1.0, Pose(0.0, 0.0, 0.0), COVARIANCE))
    for index in range(1, 480):
        pose_filter.add_odometry(1.0 + index / 240.0, Pose(0.0, 0.0, 0.0))
        wrong = Pose(*random.uniform(0.5, 1.5, 2), random.uniform(-3.0, 3.0))
        assert pose_filter.add_measurement(StampedPose(1.0 + index / 240.0, wrong, COVARIANCE)) is Outcome.OUTLIER
    assert pose_filter.pose() == pytest.approx((0.0, 0.0, 0.0))


def test_two_places_in_turns_move_no_robot():
    """As of two tags with one id: neither place has the majority."""

    def locate(now_s):
        return (0.0 if now_s < 1.0 else 1.0 + now_s * 60.0 % 2.0 // 1.0), 0.0, 0.0

    entries = list(follow(0, (60.0,), locate, 2.5, dropped=0.0))
    late = {outcome for now_s, _, outcome in entries if now_s > 1.3}
    assert late <= {Outcome.OUTLIER, Outcome.WAITING} and Outcome.OUTLIER in late


@pytest.mark.parametrize("rate_hz", [100.0, 240.0])
def test_fresh_motion_capture_of_a_driving_robot_is_never_rejected(rate_hz):
    """Poses arrive 8 ms after their time, odometry 10 ms."""
    pose_filter, outcomes = PoseFilter(), []
    events = [(0.034 * index + 0.01, 0, 0.034 * index) for index in range(150)]
    events += [(index / rate_hz + 0.008, 1, index / rate_hz) for index in range(int(5.0 * rate_hz))]

    def find_true(time_s):
        yaw_rad = 0.8 * time_s  # a circle at 0.2 m/s
        return Pose(0.25 * math.sin(yaw_rad), 0.25 - 0.25 * math.cos(yaw_rad), math.remainder(yaw_rad, math.tau))

    for _, kind, stamp_s in sorted(events):
        if kind == 0:
            outcomes += [entry[2] for entry in pose_filter.add_odometry(stamp_s, find_true(stamp_s))]
        else:
            measured = StampedPose(stamp_s, find_true(stamp_s), np.diag((1e-7, 1e-7, 1e-5)))
            outcomes.append(pose_filter.add_measurement(measured))
    assert set(outcomes[10:]) <= {Outcome.USED, Outcome.WAITING}
    assert outcomes.count(Outcome.USED) > 4.8 * rate_hz
