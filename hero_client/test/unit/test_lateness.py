"""Loops that drive by poses, as late as a test says: how fast robots still drive, and what users read."""

import math

import pytest

from hero_client.controllers.lateness import HOLD_S, REPORT_PERIOD_S, Lateness
from hero_node import Velocity


def run(lateness, period_s, steps, start_s=0.0, pose_age_s=0.0):
    """Take steps of a loop; return the share of the last one, the warnings, and the time after it."""
    warnings = []
    for step in range(steps):
        lateness.step(start_s + step * period_s)
        share = lateness.find_share(pose_age_s)
        warnings.append(lateness.take_warning())
    return share, [text for text in warnings if text], start_s + steps * period_s


def test_a_loop_that_is_on_time_drives_at_full_speed_and_says_nothing():
    for planned_s in (0.05, 0.1, 1.0):
        lateness = Lateness(planned_s)
        assert run(lateness, planned_s, 200, pose_age_s=0.07)[:2] == (1.0, [])


def test_robots_drive_no_further_unseen_than_their_margin_and_then_stop():
    speed_m_s, margin_m = 0.08, 0.012
    for period_s in (0.147, 0.2, 0.333, 0.625, 0.99):
        for pose_age_s in (0.0, 0.01):
            share = run(Lateness(), period_s, 3, pose_age_s=pose_age_s)[0]
            assert 0.0 < share * speed_m_s * (period_s + pose_age_s) < margin_m + 0.08 * 0.1
            assert (share < 1.0) == (period_s + pose_age_s > 0.2 + 1e-9)
    assert run(Lateness(), 1.01, 3)[0] == 0.0


def test_the_age_of_a_pose_slows_its_robot_alone():
    lateness = Lateness()
    lateness.step(0.0)
    assert lateness.find_share(0.3) == pytest.approx(0.5)
    assert lateness.find_share(-5.0) == lateness.find_share(0.05) == 1.0
    assert lateness.find_share(1.0) == 0.0
    text = "poses are 1.0 s old: is Wi-Fi or this PC overloaded?; robots are stopped meanwhile"
    assert lateness.take_warning() == text
    lateness = Lateness()
    lateness.step(0.0)
    assert lateness.find_shares([0.0, math.inf, math.nan]) == [1.0] * 3 and lateness.take_warning() == "", "no pose"


def test_one_late_step_slows_for_a_while_and_the_loop_recovers():
    lateness = Lateness()
    _, warnings, end_s = run(lateness, 0.1, 20)
    share, warnings, end_s = run(lateness, 0.1, 10, end_s + 0.3)
    assert share == pytest.approx(0.5) and warnings == [
        "commands are late by 0.3 s: this PC is busy; robots drive at 50 percent meanwhile"
    ]
    assert run(lateness, 0.1, int(HOLD_S / 0.1), end_s)[0] == 1.0


def test_a_late_step_counts_for_two_seconds_and_no_longer():
    for later_steps, share in ((int(HOLD_S / 0.125), 0.45), (int(HOLD_S / 0.125) + 1, 1.0)):
        lateness = Lateness(0.125)
        lateness.step(0.0)
        run(lateness, 0.125, later_steps + 1, start_s=0.5)
        assert lateness.find_share(0.0) == pytest.approx(share)


def test_lateness_that_lasts_is_told_now_and_then():
    _, warnings, end_s = run(Lateness(), 0.5, 41)
    assert len(warnings) == end_s // REPORT_PERIOD_S


def test_late_commands_stay_on_their_curve():
    lateness = Lateness()
    run(lateness, 0.4, 2)
    assert lateness.slow(Velocity(0.08, -2.0)) == pytest.approx((0.04, -1.0))
