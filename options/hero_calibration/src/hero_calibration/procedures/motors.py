"""Procedure motors: sweeps the servo pulses of all robots, and writes the centers of their servos."""

from typing import Dict, List, Mapping, NamedTuple, Sequence

import numpy as np

from hero_node import Pose, measure_distance, say

from ..errors import CalibrationError
from ..models import dead_zone
from ..robots.probe import Probe
from ..robots.session import Session

TRIES = 3
"""A sweep takes 40 s."""

AIM_TRIES = 3

MAX_MOVE_M = 0.15
"""Distance from its start, by odometry, at which a robot is stopped. Simulated robots whose centers are up to 50 us off
move up to 0.13 m."""


class MotorResult(NamedTuple):
    """Dead zones of both servos of one robot."""

    zones: List[dead_zone.DeadZone]

    def to_file(self) -> Dict[str, List[float]]:
        """Return what is kept in the robot's file."""
        return {
            "motor_centers_us": [round(zone.center_us) for zone in self.zones],
            "dead_zones_us": [round(edge_us) for zone in self.zones for edge_us in (zone.low_us, zone.high_us)],
        }

    def describe(self) -> str:
        """Return the result as a line of text."""
        return "centers %d and %d us" % tuple(self.to_file()["motor_centers_us"])


def evaluate_sweep(pulses_us: np.ndarray, speeds_m_s: np.ndarray) -> MotorResult:
    """Return the result of a sweep: pulses us, speeds m/s (2, steps; NaN: unknown).

    Raises: CalibrationError with the wheel if a dead zone cannot be found.
    """
    zones = []
    for wheel, pulses, speeds in zip(("left", "right"), pulses_us, speeds_m_s):
        try:
            zones.append(dead_zone.find_dead_zone(pulses, speeds))
        except CalibrationError as error:
            raise CalibrationError(f"the {wheel} wheel {error}") from error
    return MotorResult(zones)


def calibrate_motors(session: Session, results: Dict[int, MotorResult]) -> None:
    """Calibrate all active robots; put the results by robot into results as they are found."""
    say("motors: pulses are swept up and down, about 40 s")
    sweeps_us: Dict[int, np.ndarray] = {}

    def sweep(probes: Sequence[Probe]) -> List[float]:
        starts = {probe: probe.pose for probe in probes}
        sweeps_us.update(_plan_sweeps(session, starts))
        start_times_s = _send_pulses(session, starts, sweeps_us)
        session.settle()
        return start_times_s

    def evaluate(probe: Probe, start_times_s: List[float], _is_last: bool) -> MotorResult:
        speeds_m_s = dead_zone.measure_sweep(probe.read_wheels(), start_times_s)
        result = evaluate_sweep(sweeps_us[probe.robot_id], speeds_m_s)
        probe.write("motor_centers_us", result.to_file()["motor_centers_us"])
        return result

    session.repeat("motors", TRIES, sweep, evaluate, results)


def _plan_sweeps(session: Session, starts: Dict[Probe, Pose]) -> Dict[int, np.ndarray]:
    """Return the pulses (us) of both wheels of each robot (2, steps): around what AIM_PULSES_US tell of their centers.

    Readings may be missing: such robots try again, and are swept around the nominal center in the end.
    """
    sweeps_us: Dict[int, np.ndarray] = {}
    waiting = starts
    for _ in range(AIM_TRIES):
        pulses_us = {probe.robot_id: np.tile(dead_zone.AIM_PULSES_US, (2, 1)) for probe in waiting}
        start_times_s = _send_pulses(session, waiting, pulses_us)
        unknown: Dict[Probe, Pose] = {}
        for probe, start in waiting.items():
            try:
                speeds_m_s = dead_zone.measure_sweep(probe.read_wheels(), start_times_s)
            except CalibrationError:
                speeds_m_s = np.full((2, 2), np.nan)
            sweeps_us[probe.robot_id] = np.array([dead_zone.list_pulses(dead_zone.aim(own)) for own in speeds_m_s])
            if np.isnan(speeds_m_s).any():
                unknown[probe] = start
        waiting = unknown
        if not waiting:
            break
    return sweeps_us


def _send_pulses(session: Session, starts: Mapping[Probe, Pose], pulses_us: Dict[int, np.ndarray]) -> List[float]:
    """Send pulses (2, steps) to robots one after the other, and stop those that leave their start.

    Return when each step began.
    """

    def refuse(probe: Probe) -> None:
        raise CalibrationError(
            "moved %.0f cm instead of turning on the spot, and was stopped: are both servos mounted alike, and their "
            "centers within %.0f us of %d?"
            % (100.0 * measure_distance(probe.pose, starts[probe]), dead_zone.MAX_AIM_US, dead_zone.NOMINAL_CENTER_US)
        )

    def stop_those_that_left() -> bool:
        left = [one for one in starts if one.failure is None and measure_distance(one.pose, starts[one]) > MAX_MOVE_M]
        if left:
            session.for_each("motors", refuse, left)
        return False

    start_times_s = []
    for step in range(next(iter(pulses_us.values())).shape[1]):
        for probe in starts:
            if probe.failure is None:
                probe.set_pulses(*pulses_us[probe.robot_id][:, step].tolist())
        start_times_s.append(session.now_s)
        session.wait_for(stop_those_that_left, dead_zone.PULSE_S)
    return start_times_s
