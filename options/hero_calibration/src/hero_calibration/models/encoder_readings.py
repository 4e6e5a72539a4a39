"""Encoder readings with uncertain stamps, put on the even time steps of the robot's own timer. Pure.

A robot reads its encoders every 34 ms by its own timer (docs/robot_interface.md); its stamps are less reliable. It sets
its clock every 2.5 s, back or forward by 70 ms and more after the network stalled: set back, stamps are microseconds
apart until they have caught up; too far forward, they are times of arrival, many at once. So the steps are counted.
Stamps only tell the approximate time, and whether the robot paused: a Wi-Fi that does not take its packets stops it.
"""

from typing import NamedTuple

import numpy as np

SPAN = 8
"""Readings over which a step is measured by stamps: more than arrive at once, few per clock setting."""

LATE_READINGS = 12
"""Within this many (0.4 s) one arrives without delay."""

PAUSE_STEPS = 0.35
"""Stamps that jump by more than this, in steps, show a pause, or a clock that was set forward."""


class Readings(NamedTuple):
    """Readings of one robot in order.

    times_s: ROS time; good to some hundredths of a second, and not strictly rising (N).
    counts: number of each reading; numbers of lost readings are left out (N).
    left_ticks, right_ticks: as the robot counts them (N).
    step_s: time from one count to the next.
    heard_s: time of arrival, in ROS time (N).
    is_even: whether no pause separates a reading from the next (N - 1).
    """

    times_s: np.ndarray
    counts: np.ndarray
    left_ticks: np.ndarray
    right_ticks: np.ndarray
    step_s: float
    heard_s: np.ndarray
    is_even: np.ndarray

    def find_even(self, apart: int) -> np.ndarray:
        """Return for each two readings this many apart whether there was no pause between them (bool, N - apart)."""
        if len(self.times_s) <= apart:
            return np.zeros(0, dtype=bool)
        return np.convolve(self.is_even, np.ones(apart), "valid") == apart


def make_readings(
    stamps_s: np.ndarray, counts: np.ndarray, left_ticks: np.ndarray, right_ticks: np.ndarray, heard_s: np.ndarray
) -> Readings:
    """Return readings with even steps; stamps_s and counts rise."""
    if len(stamps_s) < 2:
        return Readings(stamps_s, counts, left_ticks, right_ticks, np.nan, heard_s, np.zeros(0, dtype=bool))
    span = min(SPAN, len(stamps_s) - 1)
    step_s = float(np.median((stamps_s[span:] - stamps_s[:-span]) / (counts[span:] - counts[:-span])))
    behind_s = stamps_s - counts * step_s
    # The network only delays readings; the earliest of some is on time.
    on_time_s = behind_s.copy()
    for later in range(1, min(LATE_READINGS, len(behind_s))):
        on_time_s[:-later] = np.minimum(on_time_s[:-later], behind_s[later:])
    is_even = np.diff(on_time_s) <= PAUSE_STEPS * step_s
    return Readings(counts * step_s + on_time_s, counts, left_ticks, right_ticks, step_s, heard_s, is_even)
