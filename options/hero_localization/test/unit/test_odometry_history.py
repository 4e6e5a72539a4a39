"""The odometry of one robot without its jumps."""

import math

import pytest

from hero_localization.filter.odometry_history import (
    JUMP_MARGIN_M,
    JUMP_MARGIN_RAD,
    KEPT_S,
    MAX_SPEED_M_S,
    MAX_TURN_RAD_S,
    OdometryHistory,
)
from hero_localization.filter.pose_hypothesis import REPLAYED_S
from hero_node import Pose, transform_pose

ORIGIN = Pose(0.0, 0.0, 0.0)


def make_history(*readings):
    history = OdometryHistory()
    for stamp_s, *pose in readings:
        history.add(stamp_s, Pose(*pose))
    return history


def test_only_what_wheels_cannot_do_in_the_time_is_a_jump():
    for elapsed_s in (0.034, 0.5):
        far_m, turn_rad = MAX_SPEED_M_S * elapsed_s + JUMP_MARGIN_M, MAX_TURN_RAD_S * elapsed_s + JUMP_MARGIN_RAD
        turn_rad = min(turn_rad, 3.0)
        for pose, jumps in (
            ((far_m - 1e-6, 0.0, 0.0), 0),
            ((0.0, far_m + 1e-6, 0.0), 1),
            ((0.0, 0.0, 1e-6 - turn_rad), 0),
            ((0.0, 0.0, -1e-6 - turn_rad), 1 if turn_rad < 3.0 else 0),
        ):
            assert make_history((1.0, *ORIGIN), (1.0 + elapsed_s, *pose)).jumps == jumps


def test_a_motion_twice_as_fast_as_wheels_is_none():
    for pose, jumps in ((0.078, 0.0, 0.0), 0), ((0.0, -0.082, 0.0), 1), ((0.0, 0.0, 2.25), 0), ((0.0, 0.0, -2.35), 1):
        assert make_history((1.0, *ORIGIN), (1.1, *pose)).jumps == jumps, pose


def test_a_restart_goes_on_where_the_robot_stood_with_its_lengths():
    history = make_history((0.0, 1.0, 2.0, 0.0), (0.1, 1.05, 2.0, 0.2), (0.2, 0.0, 0.0, 0.0), (0.3, 0.03, 0.0, -0.1))
    assert history.jumps == 1 and history.raw_pose == (0.03, 0.0, -0.1)
    expected = transform_pose(Pose(1.05, 2.0, 0.2), Pose(0.03, 0.0, -0.1))
    found = history.find(0.3)
    assert found.pose == pytest.approx(expected)
    assert (found.distance_m, found.turned_rad, found.heading_rad) == pytest.approx((0.08, 0.3, 0.1))
    middle = history.find(0.05)
    assert middle.pose == pytest.approx((1.025, 2.0, 0.1))
    assert middle[1:4] == pytest.approx((0.025, 0.1, 0.1)), "lengths of path and turns, and heading"
    assert history.find(0.25)[1:4] == pytest.approx((0.065, 0.25, 0.15))
    unobserved_s = [history.find(stamp_s).unobserved_s for stamp_s in (0.1, 0.15, 0.2, 0.3)]
    assert unobserved_s == pytest.approx((0.0, 0.05, 0.1, 0.1))
    assert history.find(9.0) == found and history.find(-0.01) is None


@pytest.mark.parametrize(
    ("elapsed_s", "before", "after", "is_restart"),
    [
        (1.6, (0.3, 0.0, 0.0), (0.0, 0.0, 0.0), True),
        (1.6, (0.0, 0.0, 1.0), (0.001, 0.001, -0.02), True),
        (1.4, (0.3, 0.0, 0.0), (0.0, 0.0, 0.0), False),
        (1.6, (0.3, 0.0, 0.0), (0.003, 0.0, 0.0), False),
        (1.6, (0.3, 0.0, 0.0), (0.0, 0.0, 0.04), False),
        (1.6, (0.01, 0.0, 0.0), (0.0, 0.0, 0.0), False),
    ],
)
def test_odometry_back_at_zero_after_a_pause_shows_a_restart(elapsed_s, before, after, is_restart):
    history = make_history((0.0, *before), (elapsed_s, *after))
    assert history.jumps == is_restart and history.find(elapsed_s).unobserved_s == is_restart * elapsed_s


def test_odometry_is_kept_for_a_time_and_old_readings_are_left_out():
    assert KEPT_S > REPLAYED_S, "what is replayed may be so old"
    history = make_history(*((0.1 * number, 0.01 * number, 0.0, 0.0) for number in range(51)))
    assert history.find(5.0 - KEPT_S + 0.05) is not None and history.find(5.0 - KEPT_S - 0.15) is None
    history.add(4.9, Pose(7.0, 0.0, 0.0))
    assert history.find(5.0).pose.x_m == pytest.approx(0.5) and history.jumps == 0


def test_turns_over_the_half_circle_are_short_and_add_up():
    history = make_history((0.0, 0.0, 0.0, 3.1), (0.1, 0.0, 0.0, -3.1), (0.2, 0.0, 0.0, 3.1))
    short_rad = 2.0 * math.pi - 6.2
    assert history.find(0.2).turned_rad == pytest.approx(2.0 * short_rad)
    assert history.find(0.2).heading_rad == pytest.approx(0.0, abs=1e-9)
    assert abs(history.find(0.05).pose.yaw_rad) == pytest.approx(math.pi, abs=1e-6), "between, it looks back"


def test_ticks_to_and_fro_are_no_distance():
    history = make_history(*((0.1 * number, 0.001 * (number % 2), 0.0, 0.0) for number in range(40)))
    assert history.find(3.9).distance_m == 0.0
    history.add(4.0, Pose(0.002, 0.0, 0.0))
    assert history.find(4.0).distance_m == pytest.approx(0.002)
