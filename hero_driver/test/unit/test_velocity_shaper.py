"""Velocities for one robot: spaced so that it accepts each, the newest wins, and a stop is never lost."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hero_driver.commands.velocity_shaper import (
    COMMAND_INTERVAL_S,
    STOPPED_MOTORS,
    ZERO_TWIST,
    VelocityShaper,
    check_twist,
)

FIRMWARE_GATE_S = 0.05
FIRMWARE_READ_CYCLE_S = 0.051


def make_twist(linear_m_s=0.0, angular_rad_s=0.0, others=(0.0, 0.0, 0.0, 0.0)):
    return struct.pack("<6d", linear_m_s, *others, angular_rad_s)


def make_motion(number):
    return make_twist(number)


# Checking commands.


def test_a_command_passes_as_it_is_also_beyond_the_limits():
    for payload in (make_twist(-0.2, 8.0, (1.0, 2.0, 3.0, 4.0)), make_twist(0.5, -9.0)):
        assert check_twist(payload) == payload


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("position", range(6))
def test_a_component_that_is_not_finite_is_refused(value, position):
    components = [0.0] * 6
    components[position] = value
    assert check_twist(struct.pack("<6d", *components)) is None


def test_infinities_of_both_signs_do_not_hide_each_other():
    assert check_twist(struct.pack("<6d", math.inf, -math.inf, 0.0, 0.0, 0.0, 0.0)) is None


def test_huge_finite_numbers_are_finite():
    payload = make_twist(1e308, 1e308, (1e308,) * 4)
    assert check_twist(payload) == payload


@pytest.mark.parametrize("length", [0, 1, 47, 49, 96])
def test_bytes_of_another_length_are_no_command(length):
    assert check_twist(bytes(length)) is None


def test_only_the_two_components_that_the_robot_uses_make_a_stop():
    assert check_twist(make_twist()) == ZERO_TWIST
    assert check_twist(make_twist(-0.0, -0.0)) == ZERO_TWIST
    assert check_twist(make_twist(0.0, 0.0, (1.0, 1.0, 1.0, 1.0))) == ZERO_TWIST
    assert check_twist(make_twist(1e-300, 0.0)) == make_twist(1e-300, 0.0)
    assert check_twist(make_twist(0.0, -0.1)) == make_twist(0.0, -0.1)


def test_stopped_motors_are_two_pulses_of_1500_us():
    assert bytes.fromhex("dc05 dc05") == STOPPED_MOTORS


# Shaping.


def test_a_first_command_goes_out_at_once_and_unchanged():
    shaper = VelocityShaper()
    shaper.offer(make_motion(1))
    assert shaper.due_in_s(5.0) == 0.0
    assert shaper.take(5.0) == make_twist(1)
    assert shaper.take(5.1) is None
    assert shaper.is_idle
    assert shaper.due_in_s(5.1) is None


def test_the_newest_command_is_sent_when_the_interval_has_passed():
    shaper = VelocityShaper()
    shaper.offer(make_motion(1))
    assert shaper.take(0.0) == make_twist(1)
    for number in (2, 3, 4):
        shaper.offer(make_motion(number))
        assert shaper.take(0.05) is None
    assert shaper.due_in_s(0.05) == pytest.approx(COMMAND_INTERVAL_S - 0.05)
    assert shaper.take(0.06) == make_twist(4)
    assert shaper.is_idle


def test_a_stop_goes_out_twice():
    shaper = VelocityShaper()
    shaper.offer(ZERO_TWIST)
    assert shaper.take(0.0) == ZERO_TWIST
    assert not shaper.is_idle
    assert shaper.take(0.059) is None
    assert shaper.take(0.06) == ZERO_TWIST
    assert shaper.take(0.12) is None
    assert shaper.is_idle


def test_a_stop_right_after_a_command_waits_for_the_interval_and_is_sent():
    shaper = VelocityShaper()
    shaper.offer(make_motion(1))
    shaper.take(0.0)
    shaper.offer(ZERO_TWIST)
    assert shaper.take(0.001) is None
    assert shaper.take(0.06) == ZERO_TWIST


def test_a_stop_replaces_a_motion_that_waits():
    shaper = VelocityShaper()
    shaper.offer(make_motion(1))
    shaper.offer(ZERO_TWIST)
    assert [shaper.take(step * 0.06) for step in range(3)] == [ZERO_TWIST, ZERO_TWIST, None]


def test_a_motion_does_not_replace_a_stop_that_waits():
    shaper = VelocityShaper()
    shaper.offer(ZERO_TWIST)
    shaper.offer(make_motion(1))
    assert [shaper.take(step * 0.06) for step in range(3)] == [ZERO_TWIST, make_twist(1), None]


def test_a_motion_takes_the_place_of_the_second_stop():
    shaper = VelocityShaper()
    shaper.offer(ZERO_TWIST)
    assert shaper.take(0.0) == ZERO_TWIST
    shaper.offer(make_motion(1))
    assert [shaper.take(0.06), shaper.take(0.12)] == [make_twist(1), None]


def test_stops_in_a_row_are_not_queued_up():
    shaper = VelocityShaper()
    for _ in range(100):
        shaper.offer(ZERO_TWIST)
    assert [shaper.take(step * 0.06) for step in range(3)] == [ZERO_TWIST, ZERO_TWIST, None]


def test_a_stop_with_other_components_goes_out_as_plain_zero():
    shaper = VelocityShaper()
    shaper.offer(check_twist(make_twist(0.0, 0.0, (1.0, 1.0, 1.0, 1.0))))
    assert shaper.take(0.0) == ZERO_TWIST


def test_a_delay_that_ends_before_the_interval_does_not_end_it():
    shaper = VelocityShaper()
    shaper.offer(make_motion(1))
    assert shaper.take(1.0) == make_motion(1)
    shaper.offer(make_motion(2))
    shaper.delay_until(1.01)
    assert shaper.due_in_s(1.0) == pytest.approx(COMMAND_INTERVAL_S)
    shaper.delay_until(1.5)
    assert shaper.due_in_s(1.0) == pytest.approx(0.5)


def test_discarding_motion_keeps_stops():
    shaper = VelocityShaper()
    shaper.offer(ZERO_TWIST)
    shaper.offer(make_motion(1))
    shaper.discard_motion()
    assert [shaper.take(step * 0.06) for step in range(3)] == [ZERO_TWIST, ZERO_TWIST, None]


# Whatever is offered and whenever it is asked for. Times are whole milliseconds.

steps = st.lists(st.tuples(st.integers(0, 120), st.one_of(st.none(), st.just(0), st.integers(1, 9))), max_size=60)


def run(script):
    """Run (pause ms, None | 0: stop | motion) steps.

    Return what was offered, as (how many were sent before, number), and what was sent, as (ms, number).
    """
    shaper = VelocityShaper()
    offered, sent = [], []
    now_ms = 0
    for pause_ms, number in [*script, (60, None), (60, None), (60, None)]:
        now_ms += pause_ms
        if number is not None:
            offered.append((len(sent), number))
            shaper.offer(make_motion(number) if number else ZERO_TWIST)
        payload = shaper.take(now_ms / 1000.0)
        if payload is not None:
            sent.append((now_ms, int(struct.unpack("<6d", payload)[0])))
    assert shaper.is_idle
    return offered, sent


@given(script=steps)
def test_velocities_are_never_closer_than_the_interval(script):
    _, sent = run(script)
    assert all(later[0] - earlier[0] >= 60 for earlier, later in zip(sent, sent[1:]))


@given(script=steps)
def test_the_last_command_offered_is_the_last_one_sent(script):
    offered, sent = run(script)
    assert [number for _, number in sent[-1:]] == [number for _, number in offered[-1:]]


@given(script=steps)
def test_every_stop_is_sent_and_sent_again_unless_a_later_command_came(script):
    offered, sent = run(script)
    for position, (sent_before, number) in enumerate(offered):
        if number != 0:
            continue
        # Nothing goes out between a stop being offered and being sent.
        after = [sent_number for _, sent_number in sent[sent_before:]]
        assert after[0] == 0
        if position == len(offered) - 1:
            assert after == [0, 0]


@given(script=steps)
def test_nothing_is_sent_that_was_not_offered_before(script):
    offered, sent = run(script)
    for position, (_, number) in enumerate(sent):
        assert any(sent_before <= position and number == offered_number for sent_before, offered_number in offered)


@given(script=steps)
def test_motion_is_sent_in_the_order_in_which_it_was_offered(script):
    numbered = [(pause, index + 1 if number else number) for index, (pause, number) in enumerate(script)]
    _, sent = run(numbered)
    motions = [number for _, number in sent if number]
    assert motions == sorted(set(motions))


@given(script=steps, phase_ms=st.integers(0, 50))
def test_a_robot_that_gates_commands_ends_up_as_last_commanded(script, phase_ms):
    offered, sent = run(script)
    state, accepted_s = None, -math.inf
    for sent_ms, number in sent:
        cycles = math.ceil((sent_ms - phase_ms) / 1000.0 / FIRMWARE_READ_CYCLE_S)
        read_s = cycles * FIRMWARE_READ_CYCLE_S
        if read_s - accepted_s > FIRMWARE_GATE_S:
            state, accepted_s = number, read_s
    assert state == (offered[-1][1] if offered else None)


@given(script=steps)
def test_due_in_s_says_when_take_has_something(script):
    shaper = VelocityShaper()
    now_s = 0.0
    for pause_ms, number in script:
        now_s += pause_ms / 1000.0
        if number is not None:
            shaper.offer(make_motion(number) if number else ZERO_TWIST)
        due_in_s = shaper.due_in_s(now_s)
        if due_in_s is None:
            assert shaper.take(now_s) is None
            continue
        assert 0.0 <= due_in_s <= COMMAND_INTERVAL_S + 1e-9
        if due_in_s > 0.0:
            assert shaper.take(now_s) is None
        now_s += due_in_s + 1e-9
        assert shaper.take(now_s) is not None
