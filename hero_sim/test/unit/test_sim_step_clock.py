"""Motions in the background of stepped robots: when their steps are taken, and what cancelling cuts short."""

from concurrent import futures

import pytest

from hero_client import GoalError
from hero_client.values.background_motion import FullWait
from hero_sim.stepped.step_clock import StepClock, StepMotion


class Rows:
    """Robots whose time passes as they are told."""

    now_ms = 1000

    def advance(self, until_ms):
        assert until_ms >= self.now_ms, "time does not go back"
        self.now_ms = until_ms


@pytest.fixture(name="clock")
def make_clock():
    return StepClock(Rows())


def take_steps(clock, notes, waits_s=(0.1,) * 3, end=None):
    """Note when each step is taken; after one that it is not to continue, stop as a robot's motion does."""
    for wait_s in waits_s:
        notes.append(clock.rows.now_ms)
        if not (yield wait_s):
            notes.append("stop")
            yield FullWait(0.06)
            notes.append(clock.rows.now_ms)
            raise GoalError("cancelled")
    if end is not None:
        raise end


def test_steps_are_taken_at_their_times_while_the_program_waits(clock):
    first, second = [], []
    motions = [StepMotion(clock, take_steps(clock, notes)) for notes in (first, second)]
    assert first == [] and not motions[0].done()
    clock.sleep(0.25)
    assert first == second == [1000, 1100, 1200] and clock.now_s == 1.25
    motions[1].result()
    assert clock.now_s == 1.3 and all(motion.done() for motion in motions)
    assert motions[0].result() is None and motions[0].exception() is None and clock.now_s == 1.3


def test_a_motion_that_is_cancelled_takes_its_next_step_at_once(clock):
    notes = []
    motion = StepMotion(clock, take_steps(clock, notes, (5.0, 5.0)))
    clock.sleep(0.02)
    assert motion.cancel() and motion.cancel()
    motion.cancel_and_wait()
    assert notes == [1000, "stop", 1080] and motion.done() and not motion.cancel()
    with pytest.raises(GoalError, match="cancelled"):
        motion.result()
    clock.sleep(10.0)
    assert notes == [1000, "stop", 1080], "the step that was due before is not taken"


def test_a_step_that_was_due_just_when_a_stop_ends_is_not_taken(clock):
    notes = []
    motion = StepMotion(clock, take_steps(clock, notes, (0.1, 5.0)))
    clock.sleep(0.04)
    motion.cancel()  # it stops until 1100 ms
    clock.sleep(1.0)
    assert notes == [1000, "stop", 1100] and isinstance(motion.exception(), GoalError)


def test_the_wait_for_a_stop_to_be_sent_is_not_cut_short(clock):
    notes = []
    motion = StepMotion(clock, take_steps(clock, notes, (5.0,)))
    clock.sleep(0.02)
    motion.cancel()
    clock.sleep(0.01)
    assert notes == [1000, "stop"]
    motion.cancel()
    clock.sleep(0.02)
    assert not motion.done()
    motion.cancel_and_wait()
    assert notes[-1] == 1080


@pytest.mark.parametrize("error", [GoalError("lost"), ValueError("number"), TypeError("kind")])
def test_an_error_of_a_motion_is_that_of_its_result(clock, error):
    motion = StepMotion(clock, take_steps(clock, [], (0.1,), error))
    assert motion.exception() is error and clock.now_s == pytest.approx(1.1)


def test_what_is_a_mistake_of_ours_ends_the_wait(clock):
    StepMotion(clock, take_steps(clock, [], (0.1,), ZeroDivisionError()))
    with pytest.raises(ZeroDivisionError):
        clock.sleep(1.0)


def test_a_result_is_waited_for_no_longer_than_asked_for(clock):
    motion = StepMotion(clock, take_steps(clock, [], (0.1,) * 20))
    with pytest.raises(futures.TimeoutError):
        motion.result(0.35)
    assert clock.now_s == pytest.approx(1.35)
    assert motion.exception(10.0) is None and clock.now_s == pytest.approx(3.0)


def test_the_shortest_wait_takes_a_millisecond(clock):
    for duration_s, expected_ms in ((0.0, 0), (1e-9, 1), (0.0004, 1), (0.0011, 2), (0.1 + 0.2, 300), (-1.0, 0)):
        before_ms = clock.rows.now_ms
        assert clock.sleep(duration_s) and clock.rows.now_ms - before_ms == expected_ms
