"""Procedure velocity: tries gains of the velocity controllers of all robots, and writes the best ones."""

from typing import Dict, List, NamedTuple, Sequence

import numpy as np

from hero_node import say

from ..models.encoder_readings import Readings
from ..models.step_response import (
    ANGULAR_RAD_S,
    NOMINAL_GAIN_M_S_US,
    ROUNDS,
    STEP_S,
    Gains,
    Response,
    Tried,
    choose_gains,
    evaluate_response,
    find_best,
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

    def measure_errors(self) -> List[float]:
        """Return the mean error of both wheels, before and after."""
        return [float(np.mean([response.mean_error for response in part])) for part in (self.before, self.after)]

    def to_file(self) -> Dict[str, List[float]]:
        """Return what is kept in the robot's file."""
        return {
            "velocity_gains": [gain for gains in self.gains for gain in gains],
            "velocity_errors": [round(error, 3) for error in self.measure_errors()],
        }

    def describe(self) -> str:
        """Return the result as a line of text."""
        return "mean error %.0f %% before, %.0f %% after" % tuple(100.0 * error for error in self.measure_errors())


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


def calibrate_velocity(session: Session, motors: Dict[int, MotorResult], results: Dict[int, VelocityResult]) -> None:
    """Calibrate all active robots, with the slopes of their servos if motors has them; put what is found in results."""
    say("velocity: gains are tried, about a minute")
    tried: Dict[int, List[List[Tried]]] = {probe.robot_id: [[], []] for probe in session.probes}
    slopes = {probe.robot_id: [NOMINAL_GAIN_M_S_US] * 2 for probe in session.probes}
    slopes.update({robot_id: [zone.gain_m_s_us for zone in found.zones] for robot_id, found in motors.items()})

    def write_next(probe: Probe) -> None:
        write_gains(probe, list(map(choose_gains, tried[probe.robot_id], slopes[probe.robot_id])))

    def write_best(probe: Probe) -> None:
        gains, responses = zip(*map(find_best, tried[probe.robot_id]))
        write_gains(probe, gains)
        results[probe.robot_id] = VelocityResult(before[probe.robot_id], list(responses), list(gains))

    before = _test(session)
    try:
        for number in range(1, ROUNDS + 1):
            say("velocity: gains %d of %d" % (number, ROUNDS))
            session.for_each("velocity", write_next)
            for robot_id, responses in _test(session).items():
                for wheel, slope, response in zip(tried[robot_id], slopes[robot_id], responses):
                    wheel.append((choose_gains(wheel, slope), response))
    finally:
        # Robots keep gains in their flash: none may be left with some that were only tried, whatever ends the tests.
        session.for_each("velocity", write_best, [probe for probe in session.probes if tried[probe.robot_id][0]])
    for robot_id, after in _test(session).items():
        results[robot_id] = results[robot_id]._replace(after=after)


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
