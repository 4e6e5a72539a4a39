"""Steps end as they must, whatever a wait does."""

import pytest

from hero_client.values.background_motion import FullWait, run_steps


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
