"""Ticks of a wheel after a command -> how well it follows; and the search for gains that make it follow better. Pure.

The robots turn on the spot, once to the left and once to the right, so that each wheel starts from rest both ways.
Each wheel has a PID of its own and so a search of its own. What a robot had before cannot be asked for: the firmware
has no service for it.
"""

from typing import Dict, List, NamedTuple, Sequence, Tuple

import numpy as np

from .encoder_steps import TICK_M, Readings
from .errors import CalibrationError

WHEEL_SEPARATION_M = 0.063
STEP_M_S = 0.08
"""Speed of the wheels in a test."""

TURN_RAD_S = 2.0 * STEP_M_S / WHEEL_SEPARATION_M
STEP_S = 1.5
"""Length of a test: shorter than the 2 s after which the robot forgets a command, longer than it needs."""

LATE_S = 1.0
"""What a wheel does after this is steady."""

REACHED = 0.9
"""Share of the wanted speed that counts as reached."""

OVERSHOOT_WEIGHT = 0.3
"""An overshoot by the whole speed is as bad as 30 % of mean error: it is soon over, but it shakes a robot."""

NOMINAL_GAIN_M_S_US = 0.25 / 220.0
"""Speed of a servo of the usual kind per pulse beyond its dead zone (assumption of hero_sim)."""

DEFAULT_GAINS = (1200.0, 2300.0, 0.1)
"""P, I, D of an erased flash: us per m/s, us per m, us per m/s^2 (VelocityControl.ino:31-47)."""

DERIVATIVE = 0.1
INTEGRALS = (4000.0, 6000.0, 8500.0)
PROPORTIONALS = (400.0, 900.0, 1400.0)
FIRST_PROPORTIONAL = 650.0
HIGHEST_GAIN = 30000.0
"""The firmware prints gains into a buffer of 100 bytes and checks none."""

LEAST_SPEEDS = 20
STANDING_STEPS = 4
STANDING_TICKS = 3
"""A wheel that made more ticks in so many readings before a test began was still turning from what was before."""

Gains = Tuple[float, float, float]
Curve = Tuple[np.ndarray, np.ndarray]


class Response(NamedTuple):
    """How a wheel followed a test.

    Attributes:
        mean_error: mean distance from the wanted speed, as a share of it.
        overshoot: highest speed beyond it, as a share.
        reached_s: when 90 % were reached; the length of the test if never.
        steady_error: of the mean speed in the end, as a share; negative: too slow.
        curves: per direction, times s and speeds m/s, forward positive in the direction of the test.
    """

    mean_error: float
    overshoot: float
    reached_s: float
    steady_error: float
    curves: Tuple[Curve, ...]

    @property
    def score(self) -> float:
        """What the search makes small."""
        return self.mean_error + OVERSHOOT_WEIGHT * self.overshoot


def find_start(readings: Readings, command_s: float, may_be_late: bool = False) -> int:
    """Return at which reading a robot that stood got a command: the last one before either wheel turned.

    The way of the command over the network, 0.03 to 0.3 s, is no fault of the controller. Of one that did not turn
    soon, that is the reading at the command: a blocked wheel has no other.

    may_be_late: whether a robot that turned, but not soon, is one with a sluggish controller.

    Raises: CalibrationError if nothing was heard of the robot, or it turned late.
    """
    if not len(readings.times_s):
        raise CalibrationError("no encoder readings came: is the network busy? try again")
    since_s = readings.times_s - command_s
    before = max(0, int(np.count_nonzero(since_s <= 0.0)) - 1)
    left, right = readings.left_ticks[before:], readings.right_ticks[before:]
    moved = np.abs(left - left[0]) + np.abs(right - right[0])
    turned_s = since_s[before:][moved >= 2.0]
    if not len(turned_s) or turned_s[0] > STEP_S:
        return before
    if turned_s[0] > STEP_S / 2.0:
        if may_be_late:
            return before
        raise CalibrationError("turned only %.1f s after its command: is the network busy? try again" % turned_s[0])
    return before + int(np.argmax(moved >= 2.0)) - 1


def measure_speed(readings: Readings, ticks: np.ndarray, start: int, end_s: float) -> Curve:
    """Return times since the reading start and a wheel's speed (m/s), each from ticks about 0.1 s apart.

    end_s: when the robot was told to stop, in ROS time; where its start came late, that is soon after.

    Raises: CalibrationError if the wheel did not stand before, or too little was heard of the robot.
    """
    if abs(ticks[start] - ticks[max(0, start - STANDING_STEPS)]) > STANDING_TICKS:
        raise CalibrationError("still turned when a test began: is the network busy? try again")
    apart = 3  # readings come every 34 ms, and a tick is 0.5 mm
    times_s = (readings.counts - readings.counts[start]) * readings.step_s
    driven_s = min(STEP_S - 0.1, end_s - readings.times_s[start])
    seen = (times_s[:-apart] >= -0.1) & (times_s[apart:] <= driven_s)
    kept = np.flatnonzero(seen & readings.find_even(apart))
    if len(kept) < LEAST_SPEEDS or times_s[kept[-1] + apart] < LATE_S + 0.2:
        raise CalibrationError(
            "only %d speeds could be measured in %.1f s: is the network busy? try again" % (len(kept), STEP_S)
        )
    ways_m = (ticks[kept + apart] - ticks[kept]) * TICK_M
    between_s = times_s[kept + apart] - times_s[kept]
    return times_s[kept] + between_s / 2.0, ways_m / between_s


def judge(curves: Sequence[Curve], wanted_m_s: float = STEP_M_S) -> Response:
    """Return how well a wheel followed, from its curves in both directions."""
    errors, overshoots, reached, steady = [], [], [], []
    for times_s, speeds_m_s in curves:
        share = speeds_m_s / wanted_m_s
        within = times_s >= 0.0
        errors.append(np.abs(share[within] - 1.0).mean())
        overshoots.append(max(0.0, float(share.max()) - 1.0))
        fast = np.flatnonzero(within & (share >= REACHED))
        reached.append(float(times_s[fast[0]]) if len(fast) else STEP_S)
        steady.append(float(share[times_s >= LATE_S].mean()) - 1.0)
    return Response(
        float(np.mean(errors)),
        float(np.mean(overshoots)),
        float(np.mean(reached)),
        float(np.mean(steady)),
        tuple(curves),
    )


class GainSearch:
    """Looks for the gains of one wheel: first for the integral, then for the proportional one.

    Ask next_gains(), let the robot try them, tell the response with receive(), until next_gains() is None.
    """

    def __init__(self, servo_gain_m_s_us: float = NOMINAL_GAIN_M_S_US) -> None:
        """Begin; gains are scaled to the servo, so that a weak one gets longer pulses."""
        # A slope far from the usual one is taken for a wrong measurement rather than for a strange servo.
        self._scale = float(np.clip(NOMINAL_GAIN_M_S_US / servo_gain_m_s_us, 0.5, 2.0))
        self._waiting: List[Gains] = [DEFAULT_GAINS]
        self._waiting += [self._make(FIRST_PROPORTIONAL, integral) for integral in INTEGRALS]
        self._has_second_round = True
        self.tried: Dict[Gains, Response] = {}

    def _make(self, proportional: float, integral: float) -> Gains:
        return (
            round(min(proportional * self._scale, HIGHEST_GAIN), 1),
            round(min(integral * self._scale, HIGHEST_GAIN), 1),
            DERIVATIVE,
        )

    @staticmethod
    def count_rounds() -> int:
        """Return how many gains are tried."""
        return 1 + len(INTEGRALS) + len(PROPORTIONALS)

    def next_gains(self) -> Gains:
        """Return what is to be tried next. Raises: IndexError after count_rounds()."""
        if not self._waiting and self._has_second_round:
            self._has_second_round = False
            integral = self.best()[0][1] / self._scale
            self._waiting = [self._make(proportional, integral) for proportional in PROPORTIONALS]
        return self._waiting[0]

    def receive(self, response: Response) -> None:
        """Take the response to what next_gains() said."""
        self.tried[self._waiting.pop(0)] = response

    def best(self) -> Tuple[Gains, Response]:
        """Return the best gains so far, and how the wheel followed with them."""
        return min(self.tried.items(), key=lambda item: item[1].score)
