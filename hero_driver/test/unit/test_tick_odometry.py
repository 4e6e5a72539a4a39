"""Odometry from wheel ticks against motions whose end is known in closed form."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hero_driver.corrections.tick_odometry import (
    Pose,
    TickOdometry,
    WheelGeometry,
)

STOCK = WheelGeometry()
PERIOD_S = 0.034
START_S = 1795240942.0
TICK_M = math.pi * 0.0492 / 288.0
SEPARATION_M = 0.063


def drive(odometry, left_m_s, right_m_s, readings, ticks=(0.0, 0.0), start_s=START_S):
    """Give readings of wheels at steady speeds, the first at start_s; return the last ticks."""
    left, right = ticks
    for reading in range(readings + 1):
        elapsed_s = reading * PERIOD_S
        left = ticks[0] + left_m_s * elapsed_s / TICK_M
        right = ticks[1] + right_m_s * elapsed_s / TICK_M
        odometry.integrate(left, right, start_s + elapsed_s)
    return left, right


def make_odometry(geometry=STOCK):
    return TickOdometry(geometry)


def assert_pose(odometry, x_m, y_m, yaw_rad):
    assert odometry.x_m == pytest.approx(x_m, abs=1e-9)
    assert odometry.y_m == pytest.approx(y_m, abs=1e-9)
    assert math.remainder(odometry.yaw_rad - yaw_rad, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)


# Motions.


def test_a_tick_is_half_a_millimeter():
    assert STOCK.ticks_m == pytest.approx((0.000537, 0.000537), abs=1e-6)


def test_the_first_reading_moves_nothing():
    odometry = make_odometry()
    odometry.integrate(12345.0, -678.0, START_S)
    assert (odometry.x_m, odometry.y_m, odometry.yaw_rad) == (0.0, 0.0, 0.0)
    assert (odometry.linear_m_s, odometry.angular_rad_s) == (0.0, 0.0)


def test_wheels_of_unequal_size_drive_an_arc():
    wheels = WheelGeometry(0.05, 0.06, 288.0, diameter_ratio=1.02)
    odometry = make_odometry(wheels)
    left_m, right_m = wheels.ticks_m
    assert (left_m + right_m) / 2.0 == pytest.approx(math.pi * 0.05 / 288.0)
    assert right_m / left_m == pytest.approx(1.02)
    odometry.integrate(0.0, 0.0, START_S)
    odometry.integrate(10.0, 10.0, START_S + 0.034)
    assert odometry.yaw_rad == pytest.approx(10.0 * (right_m - left_m) / 0.06)
    assert odometry.angular_rad_s == pytest.approx(odometry.yaw_rad / 0.034, rel=1e-4)
    assert odometry.linear_m_s == pytest.approx(10.0 * (left_m + right_m) / 2.0 / 0.034, rel=1e-4)


def test_a_quarter_circle_to_the_left_is_exact_even_in_one_step():
    odometry = make_odometry()
    radius_m = 0.1
    left_m = math.pi / 2.0 * (radius_m - SEPARATION_M / 2.0)
    right_m = math.pi / 2.0 * (radius_m + SEPARATION_M / 2.0)
    odometry.integrate(0.0, 0.0, START_S)
    odometry.integrate(left_m / TICK_M, right_m / TICK_M, START_S + 1.0)
    assert_pose(odometry, 0.1, 0.1, math.pi / 2.0)


def test_legs_follow_one_another_in_the_direction_that_the_robot_has():
    odometry = make_odometry()
    ticks = drive(odometry, 0.1, 0.1, 50)
    quarter_s = math.pi / 2.0 * SEPARATION_M / 0.1
    ticks = (ticks[0] - 0.05 * quarter_s / TICK_M, ticks[1] + 0.05 * quarter_s / TICK_M)
    odometry.integrate(*ticks, START_S + 10.0)
    drive(odometry, 0.1, 0.1, 50, ticks, START_S + 20.0)
    assert_pose(odometry, 0.17, 0.17, math.pi / 2.0)


@given(
    speed_m_s=st.floats(-0.2, 0.2),
    angular_rad_s=st.floats(-8.0, 8.0),
    readings=st.integers(1, 100),
)
def test_any_arc_ends_where_geometry_says_whatever_the_number_of_readings(speed_m_s, angular_rad_s, readings):
    odometry = make_odometry()
    left_m_s = speed_m_s - angular_rad_s * SEPARATION_M / 2.0
    right_m_s = speed_m_s + angular_rad_s * SEPARATION_M / 2.0
    drive(odometry, left_m_s, right_m_s, readings)
    duration_s = readings * PERIOD_S
    yaw_rad = angular_rad_s * duration_s
    if abs(yaw_rad) > 1e-3:
        radius_m = speed_m_s / angular_rad_s
        x_m, y_m = radius_m * math.sin(yaw_rad), radius_m * (1.0 - math.cos(yaw_rad))
    else:
        x_m, y_m = speed_m_s * duration_s, speed_m_s * duration_s * yaw_rad / 2.0
    assert odometry.x_m == pytest.approx(x_m, abs=1e-6)
    assert odometry.y_m == pytest.approx(y_m, abs=1e-6)
    assert math.remainder(odometry.yaw_rad - yaw_rad, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-6)
    assert odometry.resets == 0


def test_yaw_stays_within_half_a_turn_either_way():
    odometry = make_odometry()
    ticks = (0.0, 0.0)
    for number in range(300):
        odometry.integrate(*ticks, START_S + number * 0.2)
        assert -math.pi <= odometry.yaw_rad <= math.pi
        ticks = (ticks[0] - 40.0, ticks[1] + 40.0)


def test_the_geometry_of_the_wheels_is_that_of_the_parameters():
    odometry = make_odometry(WheelGeometry(wheel_diameter_m=0.1, wheel_separation_m=0.2, ticks_per_turn=100.0))
    odometry.integrate(0.0, 0.0, START_S)
    odometry.integrate(0.0, 100.0, START_S + 1.0)
    turn_rad = math.pi * 0.1 / 0.2
    assert_pose(odometry, 0.1 * math.sin(turn_rad), 0.1 * (1.0 - math.cos(turn_rad)), turn_rad)


# Velocity.


def test_single_ticks_are_averaged_over_the_window():
    odometry = make_odometry()
    for number in range(20):
        odometry.integrate(number // 6, number // 6, START_S + number * PERIOD_S)
        assert abs(odometry.linear_m_s) <= 2.0 * TICK_M / PERIOD_S
    # One tick in six readings; the window may see one or none.
    assert odometry.linear_m_s <= TICK_M / (5.0 * PERIOD_S) * 1.001


# Counters that begin anew.


def test_setting_the_odometry_puts_the_pose_there_and_counts_from_zero():
    odometry = make_odometry()
    drive(odometry, 0.1, 0.1, 100)
    odometry.set_pose(Pose(1.0, 2.0, math.pi / 2.0))
    assert (odometry.x_m, odometry.y_m, odometry.yaw_rad) == (1.0, 2.0, math.pi / 2.0)
    drive(odometry, 0.1, 0.1, 50, (0.0, 0.0), START_S + 100 * PERIOD_S)
    assert_pose(odometry, 1.0, 2.17, math.pi / 2.0)
    assert odometry.resets == 0


def test_ticks_between_setting_the_odometry_and_the_next_reading_count():
    odometry = make_odometry()
    drive(odometry, 0.1, 0.1, 10)
    odometry.set_pose(Pose(0.0, 0.0, 0.0))
    odometry.integrate(5.0, 5.0, START_S + 11 * PERIOD_S)
    assert_pose(odometry, 5.0 * TICK_M, 0.0, 0.0)


def test_a_reboot_keeps_the_pose_and_ends_the_velocity():
    odometry = make_odometry()
    drive(odometry, 0.1, 0.1, 100)
    odometry.expect_reset()
    assert_pose(odometry, 0.34, 0.0, 0.0)
    assert (odometry.linear_m_s, odometry.angular_rad_s) == (0.0, 0.0)
    odometry.integrate(0.0, 0.0, 2.0)
    assert_pose(odometry, 0.34, 0.0, 0.0)
    drive(odometry, 0.1, 0.1, 100, start_s=2.0)
    assert_pose(odometry, 0.68, 0.0, 0.0)
    assert odometry.resets == 0


def test_an_unannounced_reset_of_counters_moves_nothing_and_is_counted():
    odometry = make_odometry()
    drive(odometry, 0.1, 0.1, 300)
    odometry.integrate(0.0, 0.0, START_S + 301 * PERIOD_S)
    assert_pose(odometry, 1.02, 0.0, 0.0)
    assert (odometry.linear_m_s, odometry.angular_rad_s) == (0.0, 0.0)
    assert odometry.resets == 1
    odometry.integrate(10.0, 10.0, START_S + 302 * PERIOD_S)
    assert_pose(odometry, 1.02 + 10.0 * TICK_M, 0.0, 0.0)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_reading_that_is_not_finite_is_passed_over(value):
    odometry = make_odometry()
    odometry.integrate(0.0, 0.0, START_S)
    odometry.integrate(value, 0.0, START_S + PERIOD_S)
    odometry.integrate(0.0, value, START_S + 2 * PERIOD_S)
    odometry.integrate(10.0, 10.0, START_S + 3 * PERIOD_S)
    assert_pose(odometry, 10.0 * TICK_M, 0.0, 0.0)


@given(readings=st.lists(st.tuples(st.floats(width=32), st.floats(width=32), st.integers(0, 4 * 10**12)), max_size=30))
def test_any_readings_leave_a_finite_pose_and_velocity(readings):
    odometry = make_odometry()
    for left_ticks, right_ticks, stamp_ms in readings:
        odometry.integrate(left_ticks, right_ticks, stamp_ms / 1000.0)
        assert math.isfinite(odometry.x_m) and math.isfinite(odometry.y_m)
        assert math.isfinite(odometry.linear_m_s) and math.isfinite(odometry.angular_rad_s)
        assert -math.pi <= odometry.yaw_rad <= math.pi


METERS = WheelGeometry(wheel_diameter_m=1.0 / math.pi, wheel_separation_m=1.0, ticks_per_turn=1.0)
"""One tick is one meter."""


@pytest.mark.parametrize(("elapsed_s", "limit_m"), [(-5.0, 0.2), (0.125, 0.2), (0.5, 0.5), (10.0, 10.0), (16.0, 10.0)])
def test_a_step_is_believed_up_to_the_distance_of_the_fastest_wheel(elapsed_s, limit_m):
    beyond_m = 1.001 * limit_m
    for left_m, right_m, is_believed in (
        (limit_m, limit_m, True),
        (-limit_m, -limit_m, True),
        (limit_m, -limit_m, True),
        (-limit_m, limit_m, True),
        (beyond_m, limit_m, False),
        (-beyond_m, 0.0, False),
        (limit_m, beyond_m, False),
        (0.0, -beyond_m, False),
    ):
        odometry = make_odometry(METERS)
        assert not odometry.integrate(0.0, 0.0, START_S)
        assert odometry.integrate(left_m, right_m, START_S + elapsed_s) == is_believed
        assert odometry.resets == (not is_believed)


@pytest.mark.parametrize(
    ("elapsed_s", "is_known"), [(0.5, True), (1.0, True), (1.25, False), (0.0, False), (-0.5, False)]
)
def test_two_readings_tell_a_velocity_up_to_a_second_apart(elapsed_s, is_known):
    odometry = make_odometry(METERS)
    odometry.integrate(0.0, 0.0, START_S - 0.5)
    odometry.integrate(0.0, 0.0, START_S)
    odometry.integrate(0.0, 0.1, START_S + elapsed_s)
    velocity = (0.05 / (elapsed_s + 0.5), 0.1 / (elapsed_s + 0.5)) if is_known else (0.0, 0.0)
    assert (odometry.linear_m_s, odometry.angular_rad_s) == pytest.approx(velocity)


def test_counters_within_five_ticks_of_zero_look_like_a_reboot():
    for before, after, looks_reset in (
        ((21.0, 0.0), (5.0, -5.0), True),
        ((0.0, -21.0), (-5.0, 5.0), True),
        ((20.0, -20.0), (0.0, 0.0), False),
        ((21.0, 21.0), (6.0, 0.0), False),
        ((21.0, 21.0), (0.0, -6.0), False),
    ):
        odometry = make_odometry()
        assert not odometry.looks_reset(0.0, 0.0)
        odometry.integrate(*before, START_S)
        assert odometry.looks_reset(*after) == looks_reset, (before, after)


def test_six_equal_readings_end_the_velocity_and_a_set_pose_at_once():
    odometry = make_odometry()
    ticks = drive(odometry, 0.1, 0.2, 20)
    for number in range(5):
        assert odometry.linear_m_s > 0.0 and odometry.angular_rad_s > 0.0
        odometry.integrate(*ticks, START_S + (21 + number) * PERIOD_S)
    assert (odometry.linear_m_s, odometry.angular_rad_s) == (0.0, 0.0)
    drive(odometry, 0.1, 0.2, 2, ticks, START_S + 27 * PERIOD_S)
    odometry.set_pose(Pose(0.0, 0.0, 0.0))
    assert (odometry.linear_m_s, odometry.angular_rad_s) == (0.0, 0.0)
