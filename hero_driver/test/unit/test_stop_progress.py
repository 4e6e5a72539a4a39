"""The stop of one robot: how often it is sent, and when its wheels confirm it. Time and readings are the test's."""

import pytest

from hero_driver.commands.stop_progress import (
    SILENT_AFTER_S,
    StopProgress,
    StopState,
)
from hero_driver.corrections.wheel_motion import REST_READINGS, WheelMotion

READING_S = 0.034
STEP_S = 0.002


class Robot:
    """A robot whose wheels turn at the speed that turns(now_s) gives (ticks per second), read 29 times a second.

    Readings made before held_until_s come all at once then.
    """

    def __init__(self, turns, reads=True, is_acknowledged=lambda now_s: True, warm_up=0, held_until_s=0.0):
        self.wheels = WheelMotion()
        self.turns = turns
        self.reads = reads
        self.is_acknowledged = is_acknowledged
        self.held_until_s = held_until_s
        self.held = []
        self.ticks = 0.0
        self.now_s = 100.0
        self.next_reading_s = 100.0
        self.sent_s = []
        self.bursts = []
        for _ in range(warm_up):
            self.wheels.read_ticks(0.0, 0.0)
        self.stop = StopProgress(self.now_s, self.wheels)

    def read(self, now_s):
        """Give the driver what it reads now."""
        if now_s >= self.held_until_s:
            for ticks in self.held:
                self.wheels.read_ticks(ticks, ticks)
            del self.held[:]

    def run(self, until_s, tunes=False):
        """Run to until_s after the beginning; return the states in order, each once."""
        states = []
        while self.now_s < 100.0 + until_s:
            if self.now_s >= self.next_reading_s:
                self.next_reading_s += READING_S
                self.ticks += self.turns(self.now_s - 100.0) * READING_S
                if self.reads:
                    self.held.append(self.ticks)
            self.read(self.now_s - 100.0)
            if self.stop.is_due(self.is_acknowledged(self.now_s - 100.0), self.now_s):
                burst = self.stop.needs_burst(tunes, self.now_s)
                self.stop.note_sent(burst, self.now_s)
                self.sent_s.append(self.now_s - 100.0)
                self.bursts.append(burst)
            if not states or states[-1] is not self.stop.state:
                states.append(self.stop.state)
            self.now_s += STEP_S
        return states


def test_a_robot_at_rest_is_confirmed_and_gets_no_more():
    robot = Robot(lambda now_s: 0.0, warm_up=20)
    assert robot.run(1.0) == [StopState.STOPPING, StopState.AT_REST]
    sent = len(robot.sent_s)
    robot.run(10.0)
    assert len(robot.sent_s) == sent <= 12


def test_readings_of_before_the_stop_confirm_nothing():
    robot = Robot(lambda now_s: 0.0, reads=False, warm_up=20)
    assert StopState.AT_REST not in robot.run(3.0)


def test_a_robot_that_moves_is_told_until_its_wheels_rest():
    robot = Robot(lambda now_s: 186.0 if now_s < 0.3 else 0.0)
    assert robot.run(0.7) == [StopState.STOPPING, StopState.AT_REST]
    assert robot.sent_s[-1] >= 0.3


def test_a_robot_without_new_readings_is_unconfirmed_until_they_come():
    robot = Robot(lambda now_s: 0.0, reads=False, warm_up=20)
    assert robot.run(SILENT_AFTER_S + 0.5) == [StopState.STOPPING, StopState.UNCONFIRMED]
    robot.reads = True
    assert robot.run(SILENT_AFTER_S + 1.0)[-1] is StopState.AT_REST


@pytest.mark.parametrize("held_until_s", [0.9, 1.1, 1.5, 1.9])
def test_a_robot_at_rest_whose_readings_come_late_is_never_called_moving(held_until_s):
    robot = Robot(lambda now_s: 186.0 if now_s < 0.35 else 0.0, warm_up=20, held_until_s=held_until_s)
    assert robot.run(3.0) == [StopState.STOPPING, StopState.AT_REST]
    assert not any(robot.bursts)


def test_readings_of_before_the_stop_that_come_late_do_not_call_it_moving():
    robot = Robot(lambda now_s: 0.0)
    robot.held = [6.0 * number for number in range(60)]
    robot.ticks = robot.held[-1]
    robot.held_until_s = 0.05
    assert robot.run(3.0) == [StopState.STOPPING, StopState.AT_REST]
    assert not any(robot.bursts)


class BusyDriver(Robot):
    """The robot as a driver sees it that lacks CPU until free_s: 2 s behind, it reads 25 readings a second of 29."""

    def __init__(self, turns, free_s):
        super().__init__(turns)
        self.free_s = free_s
        self.blind_s = []
        self.next_read_s = 0.0
        for number in range(60):
            self.ticks += turns((number - 60) * READING_S) * READING_S
            self.held.append(self.ticks)

    def read(self, now_s):
        if now_s >= self.free_s:
            self.wheels.is_late = len(self.held) > 3
            super().read(now_s)
            self.wheels.is_late = False
        elif now_s >= self.next_read_s:
            self.next_read_s += 0.12
            self.wheels.is_late = True
            for _ in range(3):
                ticks = self.held.pop(0)
                self.wheels.read_ticks(ticks, ticks)
        if self.stop.lacks_evidence(self.now_s):
            self.blind_s.append(now_s)


def test_what_an_overloaded_driver_reads_late_does_not_call_a_robot_moving():
    robot = BusyDriver(lambda now_s: 186.0 if now_s < 0.3 else 0.0, free_s=4.0)
    assert robot.run(4.0) == [StopState.STOPPING]
    assert robot.run(5.0) == [StopState.STOPPING, StopState.AT_REST]
    assert 0.9 < robot.blind_s[0] < 1.1 and robot.blind_s[-1] < 4.1


def test_rest_of_before_a_motion_that_is_read_late_confirms_no_stop():
    robot = BusyDriver(lambda now_s: 186.0 if -0.5 < now_s < 3.0 else 0.0, free_s=2.5)
    assert robot.run(2.9) == [StopState.STOPPING]
    assert robot.run(4.5)[-1] is StopState.AT_REST


def test_wheels_that_really_turn_are_reported_once_readings_are_in_time():
    robot = BusyDriver(lambda now_s: 186.0, free_s=4.0)
    assert robot.run(4.0) == [StopState.STOPPING]
    assert robot.run(5.1) == [StopState.STOPPING, StopState.MOVING]


@pytest.mark.parametrize(
    "turns",
    [
        lambda now_s: 186.0 if now_s < 0.35 else 0.0,
        lambda now_s: 186.0 * max(0.0, 1.0 - now_s),
        lambda now_s: 372.0 if now_s < 0.6 else 0.0,
    ],
    ids=["an ordinary stop", "wheels that slow down", "a late stop"],
)
def test_wheels_that_come_to_rest_by_themselves_get_no_burst(turns):
    robot = Robot(turns, warm_up=20)
    assert robot.run(3.0)[-1] is StopState.AT_REST
    assert not any(robot.bursts)


@pytest.mark.parametrize("ticks_per_s", [12.0, 50.0, 400.0])
def test_no_speed_above_a_tick_per_rest_window_passes_for_rest(ticks_per_s):
    robot = Robot(lambda now_s: ticks_per_s)
    assert StopState.AT_REST not in robot.run(3.0)


def make_progress(readings=100):
    """Return the stop, begun at 0.0, of wheels that have given so many readings of motion."""
    wheels = WheelMotion()
    turn(wheels, readings)
    return StopProgress(0.0, wheels), wheels


def turn(wheels, readings):
    for _ in range(readings):
        wheels.read_ticks(wheels._left_ticks + 50.0, 0.0)


def rest(wheels, readings):
    for _ in range(readings):
        wheels.read_ticks(wheels._left_ticks, 0.0)


def come_to_rest():
    """Return a stop that wheels have confirmed at 0.0, after four, and these."""
    stop, wheels = make_progress()
    for _ in range(4):
        stop.note_sent(False, 0.0)
    rest(wheels, REST_READINGS)
    stop.is_due(True, 0.0)
    assert stop.state is StopState.AT_REST
    return stop, wheels


@pytest.mark.parametrize(
    ("elapsed_s", "was_burst", "interval_s"),
    [
        (0.0, False, 0.025),
        (0.49, True, 0.025),
        (0.5, False, 0.25),
        (0.5, True, 0.25),
        (4.99, False, 0.25),
        (5.0, False, 1.0),
        (5.0, True, 1.0),
    ],
)
def test_the_longer_wheels_turn_the_rarer_are_the_stops(elapsed_s, was_burst, interval_s):
    stop, wheels = make_progress()
    stop.note_sent(was_burst, elapsed_s)
    turn(wheels, 1)
    assert not stop.is_due(True, elapsed_s + 0.99 * interval_s)
    assert stop.is_due(True, elapsed_s + interval_s)
    assert not stop.is_due(False, elapsed_s + interval_s), "what is not acknowledged is not followed by more"


@pytest.mark.parametrize(
    ("readings", "after_s", "state"),
    [
        (28, 9.0, StopState.STOPPING),
        (29, 9.0, StopState.MOVING),
        (40, 28 * READING_S, StopState.STOPPING),
        (29, 29 * READING_S, StopState.MOVING),
    ],
)
def test_wheels_move_on_after_29_readings_and_the_time_that_these_take(readings, after_s, state):
    stop, wheels = make_progress()
    stop.note_sent(False, 0.0)
    stop.is_due(True, 0.0)
    turn(wheels, readings)
    stop.is_due(True, after_s)
    assert stop.state is state


@pytest.mark.parametrize(
    ("readings", "after_s", "needs_burst"),
    [(23, 9.0, False), (24, 23 * READING_S, False), (24, 24 * READING_S, True)],
)
def test_a_burst_is_needed_after_24_readings_and_their_time(readings, after_s, needs_burst):
    stop, wheels = make_progress()
    stop.note_sent(True, 0.0)
    assert not stop.needs_burst(False, 9.0), "none is acknowledged yet"
    stop.is_due(True, 0.0)
    turn(wheels, readings)
    assert stop.needs_burst(False, after_s) == needs_burst
    assert stop.needs_burst(True, 0.0), "where it is known that the robot tunes itself"
    stop.note_sent(True, 10.0)
    turn(wheels, readings)
    assert not stop.needs_burst(False, 20.0), "each one has its time"


@pytest.mark.parametrize(
    ("script", "is_at_rest"),
    [
        ([4, 5], True),
        ([3, 5], False),
        ([4, 4], False),
        ([3, 4, 1, 1], False),
        ([3, 4, 1, 5], True),
        ([4, 4, 1, 1], True),
    ],
)
def test_five_readings_of_rest_after_the_fourth_stop_confirm_it(script, is_at_rest):
    stop, wheels = make_progress()
    for stops, readings in zip(script[::2], script[1::2]):
        for _ in range(stops):
            stop.note_sent(False, 0.0)
        rest(wheels, readings)
    stop.is_due(True, 0.1)
    assert (stop.state is StopState.AT_REST) == is_at_rest
    assert stop.is_due(True, 60.0) != is_at_rest


def test_a_burst_counts_for_two_of_the_four_stops():
    stop, wheels = make_progress()
    for was_burst, is_at_rest in ((True, False), (False, False), (False, True)):
        stop.note_sent(was_burst, 0.0)
        rest(wheels, REST_READINGS)
        stop.is_due(True, 0.1)
        assert (stop.state is StopState.AT_REST) == is_at_rest


def test_wheels_that_turn_again_after_rest_have_their_time_before_a_burst():
    stop, wheels = come_to_rest()
    turn(wheels, 24)
    stop.is_due(True, 50.0)
    assert stop.state is StopState.MOVING and not stop.needs_burst(False, 50.0)
    stop.is_due(True, 50.1)
    turn(wheels, 24)
    assert stop.needs_burst(False, 51.0)


def test_wheels_that_turned_though_at_rest_rest_again_after_29_readings():
    stop, wheels = come_to_rest()
    turn(wheels, 2)
    assert stop.is_due(True, 50.0), "at once"
    assert stop.state is StopState.MOVING
    stop.note_sent(False, 50.0)
    assert stop.is_due(True, 50.03), "and as often as the first time"
    for readings, state in ((28, StopState.MOVING), (1, StopState.AT_REST)):
        rest(wheels, readings)
        stop.is_due(True, 50.1)
        assert stop.state is state
    turn(wheels, 2)
    stop.is_due(True, 60.0)
    rest(wheels, 29)
    stop.is_due(True, 60.1)
    assert stop.state is StopState.AT_REST


@pytest.mark.parametrize(("readings", "after_s"), [(0, 1.0), (20, 2.0)])
def test_a_stop_without_a_new_reading_is_unconfirmed_if_it_is_acknowledged(readings, after_s):
    for is_acknowledged in (True, False):
        stop, _ = make_progress(readings)
        stop.note_sent(False, 0.0)
        stop.is_due(is_acknowledged, 0.99 * after_s)
        assert stop.state is StopState.STOPPING
        stop.is_due(is_acknowledged, after_s)
        assert stop.state is (StopState.UNCONFIRMED if is_acknowledged else StopState.STOPPING)
        assert stop.is_due(True, 5.0) and not stop.is_due(True, 5.01)


def test_a_robot_without_readings_gets_six_stops():
    stop, _ = make_progress(0)
    assert stop.is_due(False, 0.0), "the first one at once"
    for number in range(6):
        assert stop.is_due(True, number * 0.03)
        stop.note_sent(False, number * 0.03)
    assert not stop.is_due(True, 0.3)


def test_a_stop_that_is_requested_again_is_due_at_once():
    stop, _ = make_progress()
    stop.note_sent(False, 6.0)
    stop.renew(6.01)
    assert stop.is_due(True, 6.01)
    stop.note_sent(False, 6.01)
    assert stop.is_due(True, 6.04), "its time begins anew"
