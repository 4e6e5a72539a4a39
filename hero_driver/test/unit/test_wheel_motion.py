"""When wheels are at rest, from ticks and from odometry."""

import math

import pytest

from hero_driver.corrections.wheel_motion import MOVES_KEPT, REST_READINGS, WheelMotion


def read_all(wheels, ticks):
    for left, right in ticks:
        wheels.read_ticks(left, right)


def test_the_first_reading_tells_of_no_turn_and_counts():
    wheels = WheelMotion()
    wheels.read_ticks(1000.0, -1000.0)
    assert (wheels.readings, wheels.still_readings) == (1, 0)


def test_a_wheel_on_the_edge_of_a_tick_is_at_rest():
    wheels = WheelMotion()
    read_all(wheels, [(5.0 + step % 2, 7.0) for step in range(10)])
    assert wheels.still_readings == 9


@pytest.mark.parametrize("turned", [(7.0, 7.0), (5.0, 9.0), (3.0, 7.0)])
def test_a_turn_of_either_wheel_restarts_the_count(turned):
    wheels = WheelMotion()
    read_all(wheels, [(5.0, 7.0)] * 4 + [turned])
    assert wheels.still_readings == 0
    wheels.read_ticks(*turned)
    assert wheels.still_readings == 1


def test_slow_creep_adds_up_to_a_turn():
    wheels = WheelMotion()
    read_all(wheels, [(0.2 * step, 0.0) for step in range(6)])
    assert wheels.still_readings == 5
    wheels.read_ticks(1.2, 0.0)
    assert wheels.still_readings == 0


def test_settled_wheels_may_move_by_two_ticks_and_not_by_three():
    wheels = WheelMotion()
    read_all(wheels, [(5.0, 7.0)] * REST_READINGS)
    wheels.settle()
    read_all(wheels, [(5.0, 7.0), (6.0, 8.0), (7.0, 5.0)])
    assert wheels.still_readings == REST_READINGS + 1
    for left_ticks in (8.0, 10.0):
        wheels.read_ticks(left_ticks, 7.0)
        assert wheels.still_readings == 0, "once they turn, two are a turn again"


@pytest.mark.parametrize(("later_ticks", "go_on"), [(12, True), (5, True), (4.9, False)])
def test_wheels_go_on_if_they_did_not_slow_down_by_half(later_ticks, go_on):
    wheels, left_ticks = WheelMotion(), 0.0
    wheels.read_ticks(left_ticks, 0.0)
    for step_ticks in [10.0] * (MOVES_KEPT // 2) + [float(later_ticks)] * (MOVES_KEPT // 2):
        left_ticks -= step_ticks
        wheels.read_ticks(left_ticks, 0.0)
    assert wheels.go_on == go_on
    for _ in range(REST_READINGS):
        wheels.read_ticks(left_ticks, 0.0)
    assert not wheels.go_on


def test_counters_that_are_set_to_zero_are_no_turn():
    wheels = WheelMotion()
    read_all(wheels, [(500.0, 600.0)] * REST_READINGS)
    wheels.forget_ticks()
    read_all(wheels, [(0.0, 0.0)] * 2)
    assert wheels.still_readings == REST_READINGS


@pytest.mark.parametrize("velocity", [(0.0021, 0.0), (-0.0021, 0.0), (0.0, 0.051), (0.0, -0.051), (math.nan, 0.0)])
def test_a_velocity_of_odometry_that_is_not_zero_is_a_turn(velocity):
    wheels = WheelMotion()
    for noise in ((0.0, 0.0), (0.002, -0.05), (-0.002, 0.05)):
        wheels.read_velocity(*noise)
    assert wheels.still_readings == 3
    assert wheels.go_on, "noise is no motion that slows down"
    wheels.read_velocity(*velocity)
    assert (wheels.readings, wheels.still_readings) == (4, 0)


def test_wheels_go_on_by_odometry_whether_they_drive_or_turn():
    for velocity in ((0.1, 0.0), (-0.1, 1.0), (0.0, -1.0)):
        wheels = WheelMotion()
        for _ in range(MOVES_KEPT):
            wheels.read_velocity(*velocity)
        assert wheels.go_on
        for _ in range(MOVES_KEPT // 2):
            wheels.read_velocity(*(0.4 * speed for speed in velocity))
        assert not wheels.go_on, velocity


@pytest.mark.parametrize("broken", [math.nan, math.inf])
def test_counters_that_are_not_numbers_are_no_turn_of_a_wheel(broken):
    wheels = WheelMotion()
    read_all(wheels, [(broken, 7.0)] * 10)
    assert wheels.readings == 0
    read_all(wheels, [(5.0, 7.0), (5.0, broken), (5.0, 7.0)])
    assert (wheels.readings, wheels.still_readings) == (2, 1)


def test_either_wheel_may_tremble_by_one_tick_either_way_and_not_more():
    for left_ticks, right_ticks, is_still in (
        (1.0, -1.0, True),
        (-1.0, 1.0, True),
        (1.1, 0.0, False),
        (-1.1, 0.0, False),
        (0.0, 1.1, False),
        (0.0, -1.1, False),
    ):
        wheels = WheelMotion()
        read_all(wheels, [(0.0, 0.0), (left_ticks, right_ticks)])
        assert wheels.still_readings == is_still, (left_ticks, right_ticks)


def test_wheels_that_rest_for_five_readings_do_not_go_on():
    wheels = WheelMotion()
    read_all(wheels, [(-100.0 * step, 100.0 * step) for step in range(25)])
    for still in range(1, 7):
        wheels.read_ticks(-2400.0, 2400.0)
        assert wheels.go_on == (still < 5)


def test_readings_without_a_turn_count_to_how_wheels_slow_down():
    wheels, left_ticks = WheelMotion(), 0.0
    wheels.read_ticks(left_ticks, 0.0)
    for step_ticks in [10.0] * 12 + [0.0, 0.0, 10.0, 0.0, 10.0, 0.0, 10.0, 0.0, 10.0, 0.0, 10.0, 0.0]:
        left_ticks += step_ticks
        wheels.read_ticks(left_ticks, 0.0)
    assert wheels.still_readings == 1 and not wheels.go_on


def test_late_readings_count_for_nothing_and_the_next_one_starts_from_them():
    wheels = WheelMotion()
    read_all(wheels, [(5.0, 7.0)] * 4)
    wheels.is_late = True
    read_all(wheels, [(50.0, 70.0), (500.0, 700.0), (math.nan, math.inf)])
    wheels.read_velocity(0.1, 0.0)
    assert (wheels.readings, wheels.still_readings) == (4, 3)
    wheels.is_late = False
    wheels.read_ticks(500.0, 700.0)
    assert (wheels.readings, wheels.still_readings) == (5, 4)
    wheels.read_ticks(502.0, 700.0)
    assert wheels.still_readings == 0
