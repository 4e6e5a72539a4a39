"""Values between two stamps; histories forget, and begin anew when time goes back."""

import math

import pytest

from hero_client.values.stamped_history import StampedHistory, interpolate_pose
from hero_node import Pose


@pytest.fixture
def history():
    found = StampedHistory(2.0, interpolate_pose)
    for step in range(41):
        found.add(0.1 * step, Pose(0.1 * step, 1.0, math.remainder(0.1 * step, math.tau)))
    return found


def test_poses_between_two_stamps_are_interpolated_the_shorter_way(history):
    assert history.find(3.0) == pytest.approx((3.0, 1.0, 3.0))
    assert history.find(3.15) == pytest.approx((3.15, 1.0, 3.15))


def test_there_is_nothing_before_what_is_kept_and_after_the_newest(history):
    assert history.newest_s == pytest.approx(4.0) and history.newest.x_m == pytest.approx(4.0)
    assert history.find(1.9) is None and history.find(4.01) is None
    assert StampedHistory(2.0, interpolate_pose).find(0.0) is None


def test_values_that_come_late_are_left_out(history):
    history.add(3.95, Pose(9.0, 9.0, 9.0))
    assert history.newest_s == pytest.approx(4.0) and history.find(3.95) == pytest.approx((3.95, 1.0, 3.95 - math.tau))


def test_a_history_restarts_after_a_jump_back_in_time(history):
    history.add(0.5, Pose(0.0, 0.0, 0.0))
    history.add(0.6, Pose(1.0, 0.0, 0.0))
    assert history.find(0.55) == pytest.approx((0.5, 0.0, 0.0))
    assert history.newest_s == 0.6 and history.find(4.0) is None
