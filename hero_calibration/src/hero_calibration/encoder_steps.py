"""Encoder readings with doubtful stamps -> readings with the robot's own even steps of time. Pure.

A robot reads its encoders every 34 ms by its own timer (docs/robot_interface.md); its stamps are not as good. It sets
its clock every 2.5 s, back or ahead by 70 ms and more after the network stood still; set back, stamps are microseconds
apart until they have caught up, and those of a clock that is too far ahead are times of arrival, many at once. So the
steps are counted. Stamps are asked when it was, and whether the robot paused: a Wi-Fi that does not take what it sends
stops it altogether.
"""

from typing import NamedTuple

import numpy as np

TICK_M = 0.0492 * np.pi / 288.0
"""Way of a wheel's rim for a tick (docs/robot_interface.md)."""

SPAN = 8
"""Readings over which a step is taken from stamps: more than arrive at once, few of those from one clock setting to the
next."""

LATE_READINGS = 12
"""Within so many (0.4 s) one arrives without delay."""

PAUSE_STEPS = 0.35
"""Stamps that lie further behind from some reading on, in steps, show a pause, or a clock that was set ahead."""


class Readings(NamedTuple):
    """Readings of one robot, each after the other.

    Attributes:
        times_s: when it was, in ROS time; good to some hundredths of a second, and not strictly rising (N).
        counts: which reading it is; counts of readings that were lost are left out (N).
        left_ticks, right_ticks: as the robot counts them (N).
        step_s: from one count to the next.
        heard_s: when it came, in ROS time (N).
        is_even: whether the robot went on reading from this one to the next, without a pause (N - 1).
    """

    times_s: np.ndarray
    counts: np.ndarray
    left_ticks: np.ndarray
    right_ticks: np.ndarray
    step_s: float
    heard_s: np.ndarray
    is_even: np.ndarray

    def find_even(self, apart: int) -> np.ndarray:
        """Return for each two readings so many apart whether there was no pause between them (bool, N - apart)."""
        if len(self.times_s) <= apart:
            return np.zeros(0, dtype=bool)
        return np.convolve(self.is_even, np.ones(apart), "valid") == apart


def count_steps(
    stamps_s: np.ndarray,
    counts: np.ndarray,
    left_ticks: np.ndarray,
    right_ticks: np.ndarray,
    heard_s: np.ndarray,
) -> Readings:
    """Return readings with even steps; stamps_s and counts rise."""
    if len(stamps_s) < 2:
        return Readings(stamps_s, counts, left_ticks, right_ticks, np.nan, heard_s, np.zeros(0, dtype=bool))
    span = min(SPAN, len(stamps_s) - 1)
    step_s = float(np.median((stamps_s[span:] - stamps_s[:-span]) / (counts[span:] - counts[:-span])))
    behind_s = stamps_s - counts * step_s
    # Delays in the network only make readings late; the earliest of some is in time.
    in_time_s = behind_s.copy()
    for later in range(1, min(LATE_READINGS, len(behind_s))):
        in_time_s[:-later] = np.minimum(in_time_s[:-later], behind_s[later:])
    is_even = np.diff(in_time_s) <= PAUSE_STEPS * step_s
    return Readings(counts * step_s + in_time_s, counts, left_ticks, right_ticks, step_s, heard_s, is_even)
