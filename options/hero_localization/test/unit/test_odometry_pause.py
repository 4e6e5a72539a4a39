"""The filter of a robot whose odometry pauses: what it drove is known afterwards, unless it restarted."""

import math

import numpy as np
import pytest

from hero_localization.filter.pose_filter import SYSTEMATIC, Outcome, PoseFilter
from hero_localization.filter.pose_hypothesis import StampedPose
from hero_node import Pose, transform_pose

COVARIANCE = np.diag((1e-6, 1e-6, 3.6e-5))
ZERO = Pose(0.0, 0.0, 0.0)
AWAY = Pose(1.0, 0.5, 2.0)


def pause(before, after, pause_s, seen_in_pause=()):
    """Return a filter of a robot at ZERO whose odometry comes at 1 s and again after the pause."""
    pose_filter = PoseFilter()
    pose_filter.add_odometry(1.0, before)
    assert pose_filter.add_measurement(StampedPose(1.0, ZERO, COVARIANCE)) is Outcome.FIRST
    for since_s, pose in seen_in_pause:
        pose_filter.add_measurement(StampedPose(1.0 + since_s, pose, COVARIANCE))
    pose_filter.add_odometry(1.0 + pause_s, after)
    return pose_filter


@pytest.mark.parametrize("pause_s", [1.6, 2.5, 10.0, 3600.0])
def test_after_a_pause_pose_and_uncertainty_follow_what_was_driven(pause_s):
    for driven in (ZERO, Pose(0.3, 0.0, 0.5), Pose(0.0, 0.0, -2.0)):
        pose_filter = pause(AWAY, transform_pose(AWAY, driven), pause_s)
        found = pose_filter.estimate()
        assert found.pose == pytest.approx(driven) and pose_filter.odometry.jumps == 0
        sd_x_m, _, sd_yaw_rad = np.sqrt(np.diagonal(found.covariance))
        if driven == ZERO:
            assert sd_x_m < 0.01 and sd_yaw_rad < 0.03
        else:
            assert sd_x_m > 0.01 * driven.x_m and sd_yaw_rad > 0.02
            off = transform_pose(driven, Pose(0.01 * driven.x_m, 0.0, 0.03))
            measured = StampedPose(1.0 + pause_s, off, COVARIANCE)
            assert pose_filter.add_measurement(measured) is Outcome.USED


@pytest.mark.parametrize("pause_s", [1.6, 5.0, 1e7])
def test_a_robot_that_restarts_in_a_pause_is_where_the_next_pose_shows_it(pause_s):
    for before, after in ((AWAY, ZERO), (Pose(0.0, 0.0, 1.0), ZERO), (AWAY, Pose(-0.001, 0.001, 0.02))):
        pose_filter = pause(before, after, pause_s)
        found = pose_filter.estimate()
        assert found.pose == pytest.approx(ZERO) and pose_filter.odometry.jumps == 1
        assert found.covariance[0, 0] > 0.3**2 and found.covariance[2, 2] > 3.0**2
        pose = Pose(0.1, -0.2, 1.5)
        measured = StampedPose(1.0 + pause_s, pose, COVARIANCE)
        assert pose_filter.add_measurement(measured) is Outcome.USED
        assert pose_filter.pose() == pytest.approx(pose, abs=1e-4)
        expected = COVARIANCE + np.diag(SYSTEMATIC)
        np.testing.assert_allclose(pose_filter.estimate().covariance, expected, rtol=1e-3, atol=1e-9)


def test_what_was_driven_before_a_pose_in_a_pause_does_not_count_twice():
    for seen_s in (4.9, 1.0):
        seen = [(seen_s, Pose(0.25, 0.0, 0.0))]
        pose_filter = pause(AWAY, transform_pose(AWAY, Pose(0.3, 0.0, 0.0)), 5.0, seen)
        found, since_s = pose_filter.estimate(), 5.0 - seen_s
        assert found.pose.x_m == pytest.approx(0.25, abs=0.001)
        assert math.sqrt(found.covariance[0, 0]) == pytest.approx(0.2 * since_s, rel=0.05)
        measured = StampedPose(6.0, Pose(0.25 + 0.2 * since_s, 0.0, 0.0), COVARIANCE)
        assert pose_filter.add_measurement(measured) is Outcome.USED


def test_an_image_of_the_first_moment_of_a_pause_is_dropped():
    pose_filter = pause(ZERO, ZERO, 0.05)
    assert pose_filter.add_measurement(StampedPose(1.15, Pose(0.02, 0.0, 0.0), COVARIANCE)) is Outcome.WAITING
    assert pose_filter.add_odometry(6.0, Pose(0.3, 0.0, 0.0)) == [], "it is not late"
    assert pose_filter.pose() == pytest.approx((0.3, 0.0, 0.0))
