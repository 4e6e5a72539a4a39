"""Speeds of a wheel at some servo pulses -> the dead zone of that servo, and its centre. Pure.

A continuous-rotation servo stands within some tens of microseconds around its centre. Its pulses are led up a
staircase and down again; where the wheel begins to turn on either side is found from the slope beyond, so that the
centre is known better than a step. A command that came late spoils some stairs and looks like any other, so the way up
and the way down are judged alone and must agree; where the servo lags, they err in opposite ways. Pulses are absolute
(cmd_motor): what the robot holds for its centres has no part in it.
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

SILENCE_S = 0.25
"""Where nothing was heard for so long, what was sent meanwhile came as late, or was dropped: a robot that reads many
commands at once takes the oldest."""

DROPPED_S = 0.1
"""How long after a silence a command may still be dropped; the robot drops what comes within 50 ms of another."""

LEAST_STEPS = 2
MISSING_SHARE = 0.5
"""So many stairs may be missed: with the simulated Wi-Fi of a PC that is the access point a third is. The edges follow
from eight speeds on either side, wherever they are."""

STANDING_M_S = 0.004
"""Slower than this a wheel stands: two ticks (1.1 mm) in a step may be the servo that settles."""

FIT_POINTS = 8
LEAST_POINTS = 3
"""So many speeds beyond the dead zone give its edge; further ones say less of it, fewer are lost in noise."""

AGREE_US = 8.0
"""So far apart the centres of the way up and the way down may be. Half of it is left in their mean."""

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
    """Return the pulses of the staircase (us): as many rising, and the same falling."""
    rising = list(range(NOMINAL_CENTRE_US - REACH_US, NOMINAL_CENTRE_US + REACH_US + 1, STEP_US))
    return rising + rising[::-1]


def measure_stairs(readings: Readings, begins_s: Sequence[float]) -> np.ndarray:
    """Return the speeds (m/s) of both wheels (2, stairs) at each stair of the staircase, which began at begins_s.

    NaN for a stair of which too little was heard, or whose command may have come late. Raises: CalibrationError if
    there are too many of those.
    """
    is_silent = np.diff(readings.heard_s) > SILENCE_S
    silences_s = np.stack([readings.heard_s[:-1][is_silent], readings.heard_s[1:][is_silent]])
    steps = np.diff([readings.counts, readings.left_ticks, readings.right_ticks])
    speeds = np.full((2, len(begins_s)), np.nan)
    for stair, begin_s in enumerate(begins_s):
        is_seen = (readings.times_s[:-1] >= begin_s + SETTLE_S) & (
            readings.times_s[1:] <= begin_s + PULSE_S + LATE_S
        )
        is_late = (silences_s[0] < begin_s + SETTLE_S) & (silences_s[1] > begin_s - DROPPED_S)
        if is_late.any():
            continue
        kept = steps[:, is_seen & readings.is_even]
        if kept.shape[1] >= LEAST_STEPS:
            count, *ways_ticks = kept.sum(axis=1)
            speeds[:, stair] = np.array(ways_ticks) * TICK_M / (count * readings.step_s)
    if np.isnan(speeds[0]).mean() > MISSING_SHARE:
        raise CalibrationError("too few encoder readings came: is the network busy? try again")
    return speeds


def find_dead_zone(pulses_us: Sequence[float], speeds_m_s: Sequence[float]) -> DeadZone:
    """Return the dead zone of a wheel from its speeds at the pulses of the staircase, NaN where it was not heard.

    pulses_us: the first half rises, the second falls.

    Raises: CalibrationError if the wheel does not stand somewhere and turn on both sides of it, or not at the same
    pulses on the way up and on the way down.
    """
    pulses, speeds = np.asarray(pulses_us, dtype=float), np.asarray(speeds_m_s, dtype=float)
    half = len(pulses) // 2
    up = _find_zone(pulses[:half], speeds[:half])
    down = _find_zone(pulses[half:][::-1], speeds[half:][::-1])
    if abs(up.centre_us - down.centre_us) > AGREE_US:
        raise CalibrationError(
            "stands around %.0f us with rising pulses and around %.0f us with falling ones: is the network busy? "
            "try again" % (up.centre_us, down.centre_us)
        )
    return DeadZone(*np.mean([up, down], axis=0).tolist())


def _find_zone(pulses: np.ndarray, speeds: np.ndarray) -> DeadZone:
    """Return the dead zone as one way, of rising pulses, shows it."""
    span = "%.0f to %.0f us" % (pulses[0], pulses[-1])
    is_heard = np.isfinite(speeds)
    pulses, speeds = pulses[is_heard], speeds[is_heard]
    if not (np.abs(speeds) > STANDING_M_S).any():
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
    low_us, low_slope = _find_edge(pulses[below[-FIT_POINTS:]], ahead[below[-FIT_POINTS:]])
    high_us, high_slope = _find_edge(pulses[above[:FIT_POINTS]], ahead[above[:FIT_POINTS]])
    if not -STEP_US <= high_us - low_us <= WIDEST_US:
        raise CalibrationError(
            "stands from %.0f to %.0f us, which no servo does: measure again" % (low_us, high_us)
        )
    # Of a servo that hardly stands, noise may show the edges in the wrong order.
    return DeadZone(min(low_us, high_us), max(low_us, high_us), (low_slope + high_slope) / 2.0)


def _find_edge(pulses_us: np.ndarray, speeds_m_s: np.ndarray) -> Tuple[float, float]:
    """Return where a line through the speeds meets zero (us), and its slope (m/s per us).

    The line has the median of all slopes between two points (Theil and Sen): a wrong speed or two do not bend it.
    """
    one, other = np.triu_indices(len(pulses_us), 1)
    slope = float(np.median((speeds_m_s[other] - speeds_m_s[one]) / (pulses_us[other] - pulses_us[one])))
    if slope <= 0.0:
        raise CalibrationError(
            "does not turn faster with a longer pulse: measure again, on a floor with grip"
        )
    return float(np.median(pulses_us - speeds_m_s / slope)), slope
