"""Speeds of a wheel at some servo pulses -> the dead zone of that servo, and its centre. Pure.

A continuous-rotation servo stands within some tens of microseconds around its centre. Its pulses are led up a
staircase; where the wheel begins to turn on either side is found from the slope beyond, so that the centre is known
better than a step. Pulses are absolute (cmd_motor): what the robot holds for its centres has no part in it.
"""

from typing import List, NamedTuple, Sequence, Tuple

import numpy as np

from .encoder_steps import TICK_M, Readings
from .errors import CalibrationError

NOMINAL_CENTRE_US = 1500
REACH_US = 120
"""How far from the nominal centre the staircase goes either way: far enough for a centre that is off by 60 us with a
dead zone of 40 us."""

STEP_US = 6
PULSE_S = 0.45
"""Of each pulse of the staircase; the robot holds one for 1 s."""

SETTLE_S = 0.2
"""Way of a command to the robot (up to 51 ms and the network) and the lag of its servos."""

LATE_S = 0.03
"""How long after a pulse a reading is still one of it: the next command is on its way so long."""

LEAST_STEPS = 2
MISSING_SHARE = 0.25
"""So many stairs may be missed, where the network stands still: the edges follow from six speeds on either side."""

STANDING_M_S = 0.004
"""Slower than this a wheel stands: two ticks (1.1 mm) in a step may be the servo that settles."""

FIT_POINTS = 6
LEAST_POINTS = 3
"""So many speeds beyond the dead zone give its edge; further ones say less of it, fewer are lost in noise."""

WIDEST_US = 200.0


class DeadZone(NamedTuple):
    """Where a wheel stands.

    Attributes:
        low_us, high_us: edges.
        gain_m_s_us: speed per pulse beyond the edges, without sign.
    """

    low_us: float
    high_us: float
    gain_m_s_us: float

    @property
    def centre_us(self) -> float:
        """The middle."""
        return (self.low_us + self.high_us) / 2.0


def list_pulses() -> List[int]:
    """Return the pulses of the staircase (us), rising."""
    return list(range(NOMINAL_CENTRE_US - REACH_US, NOMINAL_CENTRE_US + REACH_US + 1, STEP_US))


def measure_stairs(readings: Readings, begins_s: Sequence[float]) -> np.ndarray:
    """Return the speeds (m/s) of both wheels (2, stairs) at each stair of the staircase, which began at begins_s.

    NaN for a stair of which too little was heard. Raises: CalibrationError if there are too many of those.
    """
    is_even = readings.find_even(1)
    steps = np.diff([readings.counts, readings.left_ticks, readings.right_ticks])
    speeds = np.full((2, len(begins_s)), np.nan)
    for stair, begin_s in enumerate(begins_s):
        is_seen = (readings.times_s[:-1] >= begin_s + SETTLE_S) & (
            readings.times_s[1:] <= begin_s + PULSE_S + LATE_S
        )
        kept = steps[:, is_seen & is_even]
        if kept.shape[1] >= LEAST_STEPS:
            count, *ways_ticks = kept.sum(axis=1)
            speeds[:, stair] = np.array(ways_ticks) * TICK_M / (count * readings.step_s)
    if np.isnan(speeds[0]).mean() > MISSING_SHARE:
        raise CalibrationError("too few encoder readings came: is the network busy? try again")
    return speeds


def find_dead_zone(pulses_us: Sequence[float], speeds_m_s: Sequence[float]) -> DeadZone:
    """Return the dead zone of a wheel whose speed was measured at rising pulses.

    Raises: CalibrationError if the wheel does not stand somewhere and turn on both sides of it.
    """
    pulses, speeds = np.asarray(pulses_us, dtype=float), np.asarray(speeds_m_s, dtype=float)
    moving = np.abs(speeds) > STANDING_M_S
    span = "%.0f to %.0f us" % (pulses[0], pulses[-1])
    if not moving.any():
        raise CalibrationError("does not turn at any pulse from %s: is its servo plugged in?" % span)
    # The signs on both sides of the dead zone differ; which one is positive depends on how the servo is mounted.
    rising = np.polyfit(pulses, speeds, 1)[0] > 0.0
    ahead = speeds if rising else -speeds
    below, above = np.flatnonzero(ahead < -STANDING_M_S), np.flatnonzero(ahead > STANDING_M_S)
    if min(len(below), len(above)) < LEAST_POINTS or below[-1] >= above[0]:
        raise CalibrationError(
            "does not stand between turning one way and the other at pulses from %s: is it blocked, or its servo worn?"
            % span
        )
    low = _find_edge(pulses[below[-FIT_POINTS:]], ahead[below[-FIT_POINTS:]])
    high = _find_edge(pulses[above[:FIT_POINTS]], ahead[above[:FIT_POINTS]])
    # The fit may reach a little into the other side's points, but an edge lies where the wheel still stands.
    low_us = min(max(low[0], pulses[below[-1]]), pulses[above[0]])
    high_us = min(max(high[0], pulses[below[-1]]), pulses[above[0]])
    if not 0.0 <= high_us - low_us <= WIDEST_US:
        raise CalibrationError(
            "stands from %.0f to %.0f us, which no servo does: measure again" % (low_us, high_us)
        )
    return DeadZone(float(low_us), float(high_us), float((low[1] + high[1]) / 2.0))


def _find_edge(pulses_us: np.ndarray, speeds_m_s: np.ndarray) -> Tuple[float, float]:
    """Return where a line through the speeds meets zero (us), and its slope (m/s per us)."""
    slope, offset = np.polyfit(pulses_us, speeds_m_s, 1)
    if slope <= 0.0:
        raise CalibrationError(
            "does not turn faster with a longer pulse: measure again, on a floor with grip"
        )
    return float(-offset / slope), float(slope)
