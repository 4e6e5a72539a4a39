"""Procedure velocity: tries gains of the velocity controllers of all robots, and writes the best ones."""

from typing import Dict, List, NamedTuple, Sequence

import numpy as np

from hero_node import say

from ..models.encoder_readings import Readings
from ..models.step_response import (
    ANGULAR_RAD_S,
    NOMINAL_GAIN_M_S_US,
    STEP_S,
    Gains,
    GainSearch,
    Response,
    evaluate_response,
    find_start,
    measure_speed,
)
from ..robots.probe import Probe
from ..robots.session import COMMAND_PERIOD_S, Session
from .motors import MotorResult

TRIES = 6
"""A test takes 4 s."""


class VelocityResult(NamedTuple):
    """Gains of both wheels of one robot, and their responses before and after."""

    before: List[Response]
    after: List[Response]
    gains: List[Gains]

    def _mean(self, name: str) -> List[float]:
        """Return the mean of a value of both wheels, before and after."""
        return [float(np.mean([getattr(r, name) for r in responses])) for responses in (self.before, self.after)]

    def to_file(self) -> Dict[str, List[float]]:
        """Return what is kept in the robot's file."""
        return {
            "velocity_gains": [gain for gains in self.gains for gain in gains],
            "velocity_errors": [round(error, 3) for error in self._mean("mean_error")],
        }

    def describe(self) -> str:
        """Return the result as a line of text."""
        errors = [100.0 * error for error in self._mean("mean_error")]
        return "mean error %.0f %% before, %.0f %% after; 90 %% reached in %.2f s before, %.2f s after" % (
            *errors,
            *self._mean("reached_s"),
        )


def evaluate_test(readings: Readings, start_times_s: Sequence[float], may_be_late: bool) -> List[Response]:
    """Return the responses of both wheels to a turn to the left and one to the right.

    Raises: CalibrationError if the readings are unusable; may_be_late: as in find_start().
    """
    starts = [find_start(readings, start_s, may_be_late) for start_s in start_times_s]
    responses = []
    # In a turn to the left, the left wheel goes backward and the right one forward.
    for ticks, signs in ((readings.left_ticks, (-1.0, 1.0)), (readings.right_ticks, (1.0, -1.0))):
        curves = [
            measure_speed(readings, sign * ticks, start, start_s + STEP_S)
            for sign, start, start_s in zip(signs, starts, start_times_s)
        ]
        responses.append(evaluate_response(curves))
    return responses


def calibrate_velocity(session: Session, motors: Dict[int, MotorResult]) -> Dict[int, VelocityResult]:
    """Calibrate all active robots, with the slopes of their servos if motors has them; return the results by robot."""
    say("velocity: gains are tried, about a minute")
    searches: Dict[int, List[GainSearch]] = {}
    for probe in session.probes:
        found = motors.get(probe.robot_id)
        slopes = [zone.gain_m_s_us for zone in found.zones] if found else [NOMINAL_GAIN_M_S_US] * 2
        searches[probe.robot_id] = [GainSearch(slope) for slope in slopes]

    def write_next(probe: Probe) -> None:
        write_gains(probe, [search.next_gains() for search in searches[probe.robot_id]])

    def write_best(probe: Probe) -> None:
        write_gains(probe, [search.best()[0] for search in searches[probe.robot_id]])

    before = _test(session)
    try:
        for number in range(1, GainSearch.count_rounds() + 1):
            say("velocity: gains %d of %d" % (number, GainSearch.count_rounds()))
            session.for_each("velocity", write_next)
            for robot_id, responses in _test(session).items():
                for search, response in zip(searches[robot_id], responses):
                    search.receive(response)
    finally:
        # Robots keep gains in their flash: none may be left with some that were only tried, whatever ends the tests.
        tested = [probe for probe in session.probes if any(search.has_best for search in searches[probe.robot_id])]
        session.for_each("velocity", write_best, tested)
    return {
        robot_id: VelocityResult(before[robot_id], after, [search.best()[0] for search in searches[robot_id]])
        for robot_id, after in _test(session).items()
    }


def write_gains(probe: Probe, gains: Sequence[Gains]) -> None:
    """Write the gains of the left and the right wheel to a robot. Raises: CalibrationError."""
    probe.write("velocity_gains", [gain for wheel in gains for gain in wheel])


def _test(session: Session) -> Dict[int, List[Response]]:
    """Turn all active robots to the left and to the right; return the responses of both wheels by robot."""

    def turn(probes: Sequence[Probe]) -> List[float]:
        start_times_s: List[float] = []
        for angular_rad_s in (ANGULAR_RAD_S, -ANGULAR_RAD_S):
            session.settle()
            start_times_s.append(session.now_s)
            while session.now_s < start_times_s[-1] + STEP_S:
                for probe in probes:
                    probe.drive(angular_rad_s)
                session.pause(COMMAND_PERIOD_S)
        session.settle()
        return start_times_s

    def evaluate(probe: Probe, start_times_s: List[float], is_last: bool) -> List[Response]:
        return evaluate_test(probe.read_wheels(), start_times_s, may_be_late=is_last)

    return session.repeat("velocity", TRIES, turn, evaluate)
