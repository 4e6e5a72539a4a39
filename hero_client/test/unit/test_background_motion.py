"""Steps end as they must, whatever a wait does."""

import contextlib
from unittest.mock import create_autospec

import pytest

from hero_client.robots.group import stop_after
from hero_client.robots.robot_base import BaseRobot
from hero_client.values.background_motion import SEND_TIME_S, FullWait, run_steps
from hero_test.nonempty import nonempty


def take_notes(notes):
    try:
        while (yield 0.1):
            notes.append("step")
        notes.append("told to end")
    finally:
        notes.append("stop")
        yield FullWait(0.06)
        notes.append("stop")


def test_steps_are_told_when_a_wait_says_so_and_take_their_end():
    waits, held_s, notes = iter((True, True, False)), [], []
    run_steps(take_notes(notes), lambda duration_s: next(waits), held_s.append)
    assert notes == ["step", "step", "told to end", "stop", "stop"]
    assert held_s == [0.06]


@pytest.mark.parametrize("error", (KeyboardInterrupt, SystemExit, RuntimeError))
def test_what_ends_a_wait_is_raised_after_the_stops(error):
    held_s, notes = [], []

    def interrupt(duration_s):
        raise error

    with pytest.raises(error):
        run_steps(take_notes(notes), interrupt, held_s.append)
    assert notes == ["stop", "stop"] and held_s == [0.06]


def make_robots():
    return [create_autospec(BaseRobot, instance=True) for _ in range(2)]


@pytest.mark.parametrize("error", [None, KeyboardInterrupt, SystemExit, RuntimeError])
def test_robots_are_stopped_after_steps_however_these_end(error):
    robots, held_s = make_robots(), []

    def sleep(duration_s):
        if error:
            raise error
        return False

    with pytest.raises(error) if error else contextlib.nullcontext():
        run_steps(stop_after(take_notes([]), robots), sleep, held_s.append)
    for robot in nonempty(robots):
        robot._send_velocity.assert_called_once_with(0.0, 0.0)
    assert held_s[-1] == SEND_TIME_S


def test_steps_that_are_dropped_send_nothing_more():
    robots, notes = make_robots(), []

    def take_steps():
        try:
            yield 0.1
        finally:
            notes.append("end")

    steps = stop_after(take_steps(), robots)
    next(steps)
    steps.close()
    assert notes == ["end"]
    for robot in nonempty(robots):
        assert not robot._send_velocity.called
