"""When the next burst may go to a robot that tunes itself: after readings; without any, after times that double."""

import pytest

from hero_driver.commands.stop_progress import BURST_READINGS_MIN, BurstGate
from hero_driver.corrections.wheel_motion import WheelMotion


@pytest.fixture(name="wheels")
def make_wheels():
    wheels = WheelMotion()
    wheels.read_ticks(0.0, 0.0)
    return wheels


def test_the_first_burst_may_go_at_once(wheels):
    assert BurstGate(wheels).is_open(False, 0.0)


def test_the_next_burst_waits_for_readings_after_the_acknowledgement(wheels):
    gate = BurstGate(wheels)
    gate.note_sent(0.0)
    for _ in range(10):
        wheels.read_ticks(0.0, 0.0)
        assert not gate.is_open(False, 0.1), "it was not acknowledged"
    for _ in range(BURST_READINGS_MIN):
        assert not gate.is_open(True, 0.2)
        wheels.read_ticks(0.0, 0.0)
    assert gate.is_open(True, 0.2)


def test_without_a_further_reading_no_further_burst_goes(wheels):
    gate = BurstGate(wheels)
    gate.note_sent(0.0)
    wheels.is_late = True
    for now_s in (0.1, 1.0, 10.0, 1000.0):
        wheels.read_ticks(0.0, 0.0)
        assert not gate.is_open(True, now_s), "readings that are late show nothing"


def test_to_a_robot_without_readings_bursts_go_after_times_that_double():
    gate, now_s = BurstGate(WheelMotion()), 0.0
    for wait_s in (2.0, 4.0, 8.0):
        gate.note_sent(now_s)
        assert not gate.is_open(True, now_s + 0.99 * wait_s)
        now_s += wait_s
        assert gate.is_open(True, now_s)
