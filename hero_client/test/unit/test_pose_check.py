"""Poses against odometry: a wrong heading shows after two drives, a tag that is there twice after three jumps."""

import math

from hero_client.controllers.pose_check import FROZEN, FROZEN_M, FrozenCheck, PoseCheck
from hero_node import Pose

OFF = Pose(3.0, -2.0, 0.0)


def drive(check, drives, start_s=0.0):
    """Make drives of (m, error rad, turn rad, share of the way); return the answers at their ends."""
    x_m = y_m = 0.0
    odometry = Pose(0.0, 0.0, 0.0)
    answers, now_s = [check.add(Pose(x_m, y_m, 0.0), odometry, start_s)], start_s
    for way_m, error_rad, turn_rad, share in drives:
        heading_rad = odometry.yaw_rad
        odometry = Pose(
            odometry.x_m + way_m * math.cos(heading_rad),
            odometry.y_m + way_m * math.sin(heading_rad),
            heading_rad + turn_rad,
        )
        # What is measured as the heading is error_rad to the left of where it drives.
        x_m += share * way_m * math.cos(heading_rad - error_rad)
        y_m += share * way_m * math.sin(heading_rad - error_rad)
        now_s += 0.5
        answers.append(check.add(Pose(x_m, y_m, odometry.yaw_rad), odometry, now_s))
    return answers[1:]


def test_a_heading_that_is_off_shows_after_two_drives():
    for error_deg, is_wrong in ((44.0, False), (46.0, True), (-46.0, True), (180.0, True), (-44.0, False)):
        answers = drive(PoseCheck(), [(0.05, math.radians(error_deg), 0.0, 1.0)] * 3)
        assert [bool(answer) for answer in answers] == [False, is_wrong, is_wrong]
        if is_wrong and error_deg != 180.0:
            assert "about %.0f degrees off" % error_deg in answers[1]


def test_drives_that_show_no_direction_do_not_count():
    wrong, right = (0.05, math.pi, 0.0, 1.0), (0.05, 0.0, 0.0, 1.0)
    for drives, is_wrong in (
        ([wrong, right, wrong], False),
        ([wrong, (0.05, math.pi, 0.31, 1.0), (0.05, math.pi, -0.31, 1.0)], False),
        ([wrong, (0.05, math.pi, 0.29, 1.0)], True),
        ([wrong, (0.05, math.pi, 0.0, 0.69)], False),
        ([wrong, (0.05, math.pi, 0.0, 0.71)], True),
        ([wrong, (0.05, math.pi, 0.0, 5.0), wrong], False),  # it was carried meanwhile: a jump begins anew
        ([(0.039, math.pi, 0.0, 1.0)], False),
        ([(0.021, math.pi, 0.0, 1.0)] * 4, True),  # four short ones are two of the length
        ([(0.021, math.pi, 0.0, 1.0)] * 3, False),
    ):
        assert bool(drive(PoseCheck(), drives)[-1]) == is_wrong, drives


def test_three_jumps_within_ten_seconds_are_too_many():
    for jump_m, times_s, is_wrong in (
        (0.3, (0.1, 5.0, 10.1), True),
        (0.3, (0.1, 5.0, 10.2), False),
        (0.3, (0.1, 5.0), False),
        (0.09, (0.1, 5.0, 9.0), False),
        (0.3, (0.1, 20.0, 25.0, 29.0), True),
    ):
        check, x_m, answer = PoseCheck(), 0.0, ""
        check.add(OFF, Pose(0.0, 0.0, 0.0), 0.0)
        for now_s in times_s:
            x_m = jump_m - x_m
            answer = check.add(Pose(OFF.x_m + x_m, OFF.y_m, 0.0), Pose(0.0, 0.0, 0.0), now_s)
        assert bool(answer) == is_wrong
        assert not is_wrong or "the last time by 0.30 m" in answer


def test_a_jump_of_the_odometry_counts_and_begins_a_drive_anew():
    check = PoseCheck()
    check.add(OFF, Pose(0.0, 0.0, 0.0), 0.0)
    assert check.add(OFF, Pose(5.0, 0.0, 0.0), 0.1) == "", "its odometry was set"
    # What was driven before it does not count with what comes after it.
    assert check.add(Pose(OFF.x_m + 0.03, OFF.y_m, 0.0), Pose(5.03, 0.0, 0.0), 0.2) == ""
    assert drive(check, [(0.05, 0.0, 0.0, 1.0)] * 3, 1.0) == ["", "", ""]


def test_a_pose_that_stays_the_same_while_wheels_turn_is_frozen():
    for odometry, is_frozen in (
        (Pose(1.1 * FROZEN_M, 0.0, 0.0), True),
        (Pose(0.0, 0.0, 1.1), True),
        (Pose(0.9 * FROZEN_M, 0.0, 0.9), False),
    ):
        check = FrozenCheck()
        assert check.add(OFF, Pose(0.0, 0.0, 0.0), 50.0) == ""
        assert check.add(OFF, odometry, 52.9) == "", "it may be late"
        assert check.add(OFF, odometry, 53.0) == (FROZEN if is_frozen else "")
        assert check.add(OFF, odometry, 150.0) == (FROZEN if is_frozen else ""), "as long as it stays"
        assert check.add(Pose(3.1, -2.0, 0.0), odometry, 151.0) == ""
