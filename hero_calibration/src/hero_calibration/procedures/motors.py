"""Procedure motors: sweeps the servo pulses of all robots, and writes the centers of their servos."""

from typing import Dict, List, NamedTuple, Optional, Sequence

import numpy as np

from hero_node.command_line import say

from ..errors import CalibrationError
from ..models import dead_zone
from ..robots.probe import Probe
from ..robots.session import Session

TRIES = 3
"""A sweep takes 40 s."""


class MotorResult(NamedTuple):
    """Sweep of one robot: pulses us, speeds m/s of both wheels (NaN: unknown), dead zones."""

    pulses_us: List[int]
    speeds_m_s: np.ndarray
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


def evaluate_sweep(pulses_us: List[int], speeds_m_s: np.ndarray) -> MotorResult:
    """Return the result of a sweep. Raises: CalibrationError with the wheel if a dead zone cannot be found."""
    zones = []
    for wheel, speeds in zip(("left", "right"), speeds_m_s):
        try:
            zones.append(dead_zone.find_dead_zone(pulses_us, speeds))
        except CalibrationError as error:
            raise CalibrationError("the %s wheel %s" % (wheel, error)) from error
    return MotorResult(pulses_us, speeds_m_s, zones)


def calibrate_motors(session: Session, results: Optional[Dict[int, MotorResult]] = None) -> Dict[int, MotorResult]:
    """Calibrate all active robots; return the results by robot, in results: see Session.repeat()."""
    say("motors: pulses are swept up and down, about 40 s")
    pulses_us = dead_zone.list_pulses()

    def sweep(probes: Sequence[Probe]) -> List[float]:
        start_times_s = []
        for pulse_us in pulses_us:
            for probe in probes:
                probe.set_pulses(pulse_us)
            start_times_s.append(session.now_s)
            session.pause(dead_zone.PULSE_S)
        session.settle()
        return start_times_s

    def evaluate(probe: Probe, start_times_s: List[float], _is_last: bool) -> MotorResult:
        speeds_m_s = dead_zone.measure_sweep(probe.read_wheels(), start_times_s)
        result = evaluate_sweep(pulses_us, speeds_m_s)
        probe.write("motor_centers_us", result.to_file()["motor_centers_us"])
        return result

    return session.repeat("motors", TRIES, sweep, evaluate, results)
