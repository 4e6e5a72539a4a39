"""Finds the dead zone of a servo, and its center, from the speeds of its wheel in a sweep of pulses. Pure.

A continuous-rotation servo stops within some tens of microseconds around its center. Pulses are swept up and down in
steps; the pulses at which the wheel starts to turn follow from the slope of the speeds beyond, more precisely than a
step. A late command spoils some steps unnoticed, so the two sweeps are evaluated separately and must agree; a lag of
the servo moves them in opposite directions. Pulses are absolute (cmd_motor): the centers in the robot do not matter.
"""

from typing import List, NamedTuple, Sequence, Tuple

import numpy as np

from hero_node.robot_constants import TICK_M

from ..errors import CalibrationError
from .encoder_readings import Readings

NOMINAL_CENTER_US = 1500
REACH_US = 120
"""Extent of the sweep to either side: enough for a center that is off by 60 us, and a dead zone of 40 us."""

AIM_PULSES_US = (NOMINAL_CENTER_US - REACH_US, NOMINAL_CENTER_US + REACH_US)
"""Sent before a sweep, to know about where the centers are."""

AIM_DEAD_ZONE_US = 25.0
"""Usual half of a dead zone, for the estimate of a center before the sweep."""

MAX_AIM_US = 60.0
"""Error of an estimated center: a servo that is further off is refused."""

STEP_US = 6
PULSE_S = 0.45
"""Duration of each step; the robot holds a pulse for 1 s."""

SETTLE_S = 0.2
"""Delay of a command to the robot (up to 51 ms and the network) and the lag of its servos."""

LATE_S = 0.03
"""Readings this long after the end of a step still belong to it: the next command is as late."""

SILENCE_S = 0.25
"""Commands sent during a silence this long came as late, or were dropped: a robot that reads many commands at once
takes the oldest."""

DROPPED_S = 0.1
"""A command may still be dropped this long after a silence: the robot drops one within 50 ms of another."""

MIN_READINGS = 2
MISSING_SHARE = 0.5
"""Share of the steps; with the simulated Wi-Fi of a PC that is the access point a third is missing."""

REST_M_S = 0.004
"""A slower wheel is at rest: two ticks (1.1 mm) in a step may be the servo that settles."""

FIT_POINTS = 8
MIN_POINTS = 3
"""Speeds beyond the dead zone that give its edge: further ones tell less of it, fewer are lost in noise."""

AGREE_US = 8.0
"""Largest difference of the centers of both sweeps. Half of it is left in their mean."""

WIDEST_US = 200.0


class DeadZone(NamedTuple):
    """Pulses at which a wheel is at rest; gain_m_s_us: speed per pulse beyond them, without sign."""

    low_us: float
    high_us: float
    gain_m_s_us: float

    @property
    def center_us(self) -> float:
        """The middle."""
        return (self.low_us + self.high_us) / 2.0


def list_pulses(center_us: int = NOMINAL_CENTER_US) -> List[int]:
    """Return the pulses of a sweep (us): first rising, then the same falling."""
    rising = list(range(center_us - REACH_US, center_us + REACH_US + 1, STEP_US))
    return rising + rising[::-1]


def aim(speeds_m_s: np.ndarray) -> int:
    """Return a center (us) to sweep around, good to some 10 us, from the speeds at AIM_PULSES_US.

    With the same pulses for both wheels, a robot whose centers are off in opposite directions drives while it hardly
    turns; with pulses equally far from the centers it turns on the spot.
    """
    low_m_s, high_m_s = speeds_m_s.tolist()
    if not abs(high_m_s - low_m_s) > 2.0 * REST_M_S:
        return NOMINAL_CENTER_US  # the sweep will tell what is wrong with the wheel
    off_us = -(low_m_s + high_m_s) / (high_m_s - low_m_s) * (REACH_US - AIM_DEAD_ZONE_US)
    return NOMINAL_CENTER_US + round(min(max(off_us, -MAX_AIM_US), MAX_AIM_US))


def measure_sweep(readings: Readings, start_times_s: Sequence[float]) -> np.ndarray:
    """Return the speeds (m/s) of both wheels (2, steps) at each step of a sweep, by their start times.

    NaN for a step with too few readings, or whose command may have come late. Raises: CalibrationError if there are
    too many of those.
    """
    is_silent = np.diff(readings.heard_s) > SILENCE_S
    silences_s = np.stack([readings.heard_s[:-1][is_silent], readings.heard_s[1:][is_silent]])
    changes = np.diff([readings.counts, readings.left_ticks, readings.right_ticks])
    speeds = np.full((2, len(start_times_s)), np.nan)
    for step, start_s in enumerate(start_times_s):
        first_s, last_s = start_s + SETTLE_S, start_s + PULSE_S + LATE_S
        is_seen = (readings.times_s[:-1] >= first_s) & (readings.times_s[1:] <= last_s)
        is_late = (silences_s[0] < first_s) & (silences_s[1] > start_s - DROPPED_S)
        kept = changes[:, is_seen & readings.is_even]
        if kept.shape[1] >= MIN_READINGS and not is_late.any():
            count, *distances_ticks = kept.sum(axis=1)
            speeds[:, step] = np.array(distances_ticks) * TICK_M / (count * readings.step_s)
    if np.isnan(speeds[0]).mean() > MISSING_SHARE:
        raise CalibrationError("too few encoder readings came: is the network busy? try again")
    return speeds


def find_dead_zone(pulses_us: Sequence[float], speeds_m_s: Sequence[float]) -> DeadZone:
    """Return the dead zone of a wheel from its speeds (NaN: unknown) at the pulses of list_pulses().

    Raises: CalibrationError if the wheel does not rest at some pulses and turn on both sides of them, or if the two
    sweeps disagree.
    """
    pulses, speeds = np.asarray(pulses_us, dtype=float), np.asarray(speeds_m_s, dtype=float)
    half = len(pulses) // 2
    up = _find_zone(pulses[:half], speeds[:half])
    down = _find_zone(pulses[half:][::-1], speeds[half:][::-1])
    if abs(up.center_us - down.center_us) > AGREE_US:
        raise CalibrationError(
            "stops around %.0f us with rising pulses and around %.0f us with falling ones: is the network busy? "
            "try again" % (up.center_us, down.center_us)
        )
    return DeadZone(*np.mean([up, down], axis=0).tolist())


def _find_zone(pulses: np.ndarray, speeds: np.ndarray) -> DeadZone:
    """Return the dead zone as a sweep in one direction, sorted by pulse, shows it."""
    span = f"{pulses[0]:.0f} to {pulses[-1]:.0f} us"
    is_known = np.isfinite(speeds)
    pulses, speeds = pulses[is_known], speeds[is_known]
    if not (np.abs(speeds) > REST_M_S).any():
        raise CalibrationError(f"does not turn at any pulse from {span}: is its servo plugged in?")
    # Which side of the dead zone is forward depends on how the servo is mounted.
    speeds = speeds * np.sign(np.polyfit(pulses, speeds, 1)[0])
    below, above = np.flatnonzero(speeds < -REST_M_S), np.flatnonzero(speeds > REST_M_S)
    if min(len(below), len(above)) < MIN_POINTS or below[-1] >= above[0]:
        raise CalibrationError(
            "does not stop between turning one way and the other at pulses from %s: is it blocked, or its servo worn?"
            % span
        )
    low_us, low_slope = _find_edge(pulses[below[-FIT_POINTS:]], speeds[below[-FIT_POINTS:]])
    high_us, high_slope = _find_edge(pulses[above[:FIT_POINTS]], speeds[above[:FIT_POINTS]])
    if not -STEP_US <= high_us - low_us <= WIDEST_US:
        raise CalibrationError(f"stops from {low_us:.0f} to {high_us:.0f} us, which is implausible: try again")
    # If the dead zone is narrow, noise may show the edges in the wrong order.
    return DeadZone(min(low_us, high_us), max(low_us, high_us), (low_slope + high_slope) / 2.0)


def _find_edge(pulses_us: np.ndarray, speeds_m_s: np.ndarray) -> Tuple[float, float]:
    """Return the pulse (us) at which a line through the speeds meets zero, and its slope (m/s per us).

    The slope is the median over all pairs of points (Theil and Sen): a wrong speed or two do not change it.
    """
    one, other = np.triu_indices(len(pulses_us), 1)
    slope = float(np.median((speeds_m_s[other] - speeds_m_s[one]) / (pulses_us[other] - pulses_us[one])))
    if slope <= 0.0:
        raise CalibrationError("does not turn faster with a longer pulse: try again, on a floor with grip")
    return float(np.median(pulses_us - speeds_m_s / slope)), slope
