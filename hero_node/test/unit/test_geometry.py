"""Poses and frames in the plane."""

import math

import pytest

from hero_node.geometry import Pose, find_frame


def test_a_frame_is_found_from_where_something_in_it_is_and_is_seen():
    # A quarter turn to the left and one meter forward of a frame at (1, 0), which is turned to the left, too.
    pose = Pose(1.0, 1.0, math.pi)
    frame = find_frame(pose, Pose(1.0, 0.0, math.pi / 2))
    assert frame == pytest.approx((1.0, 0.0, math.pi / 2))
    assert find_frame(pose, Pose(0.0, 0.0, 0.0)) == pytest.approx(pose)
