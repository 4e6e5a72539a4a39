"""Evaluates how a wheel follows a step of its speed, and searches for better gains. Pure.

The robots turn on the spot, once to each side: each wheel starts from rest in both directions. Each wheel has its own
PID, and its own search. The firmware has no service that tells the gains of a robot.
"""

from typing import NamedTuple, Sequence, Tuple

import numpy as np

from hero_node.robot_constants import TICK_M, WHEEL_SEPARATION_M

from ..errors import CalibrationError
from .encoder_readings import Readings

STEP_M_S = 0.08
"""Speed of the wheels in a test."""

ANGULAR_RAD_S = 2.0 * STEP_M_S / WHEEL_SEPARATION_M
STEP_S = 1.5
"""Duration of a test: shorter than the robot's watchdog of 2 s, longer than the response."""

LATE_S = 1.0
"""Readings must reach at least 0.2 s beyond this."""

OVERSHOOT_WEIGHT = 0.3
"""An overshoot of 100 % weighs as much as 30 % of mean error: it is short, but it shakes the robot."""

NOMINAL_GAIN_M_S_US = 0.25 / 220.0
"""Speed per pulse beyond the dead zone of a common servo (assumption of hero_sim)."""

DEFAULT_GAINS = (1200.0, 2300.0, 0.1)
"""P, I, D of an erased flash: us per m/s, us per m, us per m/s^2 (VelocityControl.ino:31-47)."""

DERIVATIVE = 0.1
INTEGRALS = (4000.0, 6000.0, 8500.0)
PROPORTIONALS = (400.0, 900.0, 1400.0)
FIRST_PROPORTIONAL = 650.0
ROUNDS = 1 + len(INTEGRALS) + len(PROPORTIONALS)

MIN_SPEEDS = 20
APART = 3
"""Readings between which a speed is measured: they come every 34 ms, and a tick is 0.5 mm."""

REST_READINGS = 4
REST_TICKS = 3
"""A wheel that made more ticks in the readings before a test was not at rest."""

Gains = Tuple[float, float, float]
Curve = Tuple[np.ndarray, np.ndarray]


class Response(NamedTuple):
    """Response of a wheel to a step: mean deviation from the target speed, highest speed beyond it, as shares of it."""

    mean_error: float
    overshoot: float

    @property
    def score(self) -> float:
        """The search minimizes it."""
        return self.mean_error + OVERSHOOT_WEIGHT * self.overshoot


Tried = Tuple[Gains, Response]


def find_start(readings: Readings, command_s: float, may_be_late: bool = False) -> int:
    """Return the index of the last reading before either wheel of a robot at rest turned.

    This leaves out the delay of the command in the network, 0.03 to 0.3 s. If no wheel turned, it is the reading at the
    command.

    may_be_late: whether a late start is accepted as that of a sluggish controller.

    Raises: CalibrationError without readings, or for a late start.
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
        raise CalibrationError(f"turned only {turned_s[0]:.1f} s after its command: is the network busy? try again")
    return before + int(np.argmax(moved >= 2.0)) - 1


def measure_speed(readings: Readings, ticks: np.ndarray, start: int, end_s: float) -> Curve:
    """Return times since the reading start and the speeds of a wheel (m/s).

    end_s: when the robot was commanded to stop, in ROS time.

    Raises: CalibrationError if the wheel was not at rest before, or too few readings arrived.
    """
    if abs(ticks[start] - ticks[max(0, start - REST_READINGS)]) > REST_TICKS:
        raise CalibrationError("still turned when a test started: is the network busy? try again")
    times_s = (readings.counts - readings.counts[start]) * readings.step_s
    driven_s = min(STEP_S - 0.1, end_s - readings.times_s[start])
    seen = (times_s[:-APART] >= -0.1) & (times_s[APART:] <= driven_s)
    kept = np.flatnonzero(seen & readings.find_even(APART))
    if len(kept) < MIN_SPEEDS or times_s[kept[-1] + APART] < LATE_S + 0.2:
        text = f"only {len(kept)} speeds could be measured in {STEP_S:.1f} s: is the network busy? try again"
        raise CalibrationError(text)
    distances_m = (ticks[kept + APART] - ticks[kept]) * TICK_M
    between_s = times_s[kept + APART] - times_s[kept]
    return times_s[kept] + between_s / 2.0, distances_m / between_s


def evaluate_response(curves: Sequence[Curve]) -> Response:
    """Return how well a wheel followed, from its curves in both directions."""
    errors, overshoots = [], []
    for times_s, speeds_m_s in curves:
        share = speeds_m_s / STEP_M_S
        errors.append(np.abs(share[times_s >= 0.0] - 1.0).mean())
        overshoots.append(max(0.0, float(share.max()) - 1.0))
    return Response(float(np.mean(errors)), float(np.mean(overshoots)))


def choose_gains(tried: Sequence[Tried], servo_gain_m_s_us: float) -> Gains:
    """Return the gains of a wheel to try next, in ROUNDS: first for the integral gain, then the proportional one."""
    if not tried:
        return DEFAULT_GAINS
    # Scaled to the servo: a weak one needs longer pulses. A slope far from the nominal one is rather measured wrongly.
    scale = float(np.clip(NOMINAL_GAIN_M_S_US / servo_gain_m_s_us, 0.5, 2.0))
    number = len(tried) - 1
    if number < len(INTEGRALS):
        proportional, integral = FIRST_PROPORTIONAL, scale * INTEGRALS[number]
    else:
        proportional, integral = PROPORTIONALS[number - len(INTEGRALS)], find_best(tried)[0][1]
    # At most 17,000: the firmware prints gains into a buffer of 100 bytes without a check.
    return round(scale * proportional, 1), round(integral, 1), DERIVATIVE


def find_best(tried: Sequence[Tried]) -> Tried:
    """Return the best gains, and the response to them."""
    return min(tried, key=lambda item: item[1].score)
