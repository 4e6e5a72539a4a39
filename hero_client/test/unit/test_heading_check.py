"""What the drives of a robot tell of a heading that is measured from outside."""

import math

import pytest

from hero_client.controllers.heading_check import DRIVES, MIN_DRIVE_M, HeadingCheck, is_upside_down
from hero_node import Pose, transform_pose

ORIGIN = Pose(0.0, 0.0, 0.0)


def drive(check, error_rad, steps_m, share=1.0, turn_rad=0.0):
    seen = odometry = ORIGIN
    check.add(Pose(*seen[:2], error_rad), odometry)
    for step_m in steps_m:
        odometry = transform_pose(odometry, Pose(step_m, 0.0, turn_rad))
        seen = transform_pose(seen, Pose(share * step_m, 0.0, turn_rad))
        check.add(Pose(*seen[:2], seen.yaw_rad + error_rad), odometry)
    return check.error_rad


def test_a_tag_that_is_turned_shows_after_some_straight_drives():
    for error_rad in (0.2, -0.4, math.pi - 0.01):
        assert drive(HeadingCheck(), error_rad, [MIN_DRIVE_M + 0.001] * DRIVES) == pytest.approx(error_rad)
        assert drive(HeadingCheck(), error_rad, [MIN_DRIVE_M + 0.001] * (DRIVES - 1)) is None
        assert drive(HeadingCheck(), error_rad, [-0.05] * DRIVES) == pytest.approx(error_rad), "backward, too"
    assert drive(HeadingCheck(), 0.2, [MIN_DRIVE_M / 4.0 + 0.001] * 4 * DRIVES) == pytest.approx(0.2), "by and by"


def test_what_is_too_short_curved_or_held_shows_no_heading():
    assert drive(HeadingCheck(), 0.2, [MIN_DRIVE_M / 20.0] * 20) is None
    assert drive(HeadingCheck(), 0.2, [0.05] * 9, turn_rad=0.31) is None
    assert drive(HeadingCheck(), 0.2, [0.05] * 9, share=0.69) is None
    assert drive(HeadingCheck(), 0.2, [0.05] * 9, share=0.71, turn_rad=0.0) == pytest.approx(0.2)
    for error_rad, is_so in ((2.3, False), (2.4, True), (-2.4, True), (2.0 * math.pi - 0.1, False)):
        assert is_upside_down(error_rad) == is_so
