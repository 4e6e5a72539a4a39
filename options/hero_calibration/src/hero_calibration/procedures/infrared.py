"""Procedure infrared: turns each sensor of all robots to a wall, writes their constants, and checks them."""

import math
from functools import partial
from typing import Dict, List, NamedTuple, Sequence

import numpy as np

from hero_node import Pose, invert_pose, say, transform_pose
from hero_node.robot_constants import BEAM_NAMES, BEAMS

from ..errors import CalibrationError
from ..models import infrared_model as model
from ..robots.probe import Probe
from ..robots.session import Session

TURN_S = 2.5
"""For 45 degrees; the position controller ends 3 s after its command."""

TURN_REACHED_RAD = math.radians(1.5)
TURN_TOLERANCE_RAD = math.radians(10.0)
TURN_TRIES = 3
SCAN_TIMEOUT_S = 15.0


class InfraredResult(NamedTuple):
    """Constants of one robot's sensors, and the errors of its ranges before and after (m)."""

    counts_m2: List[float]
    before_m: np.ndarray
    after_m: np.ndarray

    def to_file(self) -> Dict[str, List[float]]:
        """Return what is kept in the robot's file."""
        return {
            "infrared_counts_m2": [round(value, 5) for value in self.counts_m2],
            "range_errors_before_m": [round(float(error), 4) for error in self.before_m],
            "range_errors_after_m": [round(float(error), 4) for error in self.after_m],
        }

    def describe(self) -> str:
        """Return the result as a line of text."""
        before, after = (
            f"{1000.0 * np.abs(errors_m).max():.0f} mm" if np.isfinite(errors_m).all() else unknown
            for errors_m, unknown in ((self.before_m, "unknown (no calibration)"), (self.after_m, "not checked"))
        )
        return f"largest range error at 10 cm {before} before, {after} after"


def calibrate_infrared(session: Session, results: Dict[int, InfraredResult]) -> None:
    """Calibrate all active robots, which face a wall; put the results by robot into results as they are found."""
    say(f"infrared: about {BEAMS * (2 * TURN_S + (model.SAMPLES + model.CHECK_SAMPLES) / 5.0):.0f} s")
    walls: Dict[int, Pose] = {}
    first = _face_wall_with_each_sensor(session, "infrared", model.SAMPLES, walls)

    def write(probe: Probe) -> None:
        facings = first[probe.robot_id]
        counts_m2 = model.compute_calibration(facings)
        probe.write("infrared_counts_m2", counts_m2)
        unknown_m = np.full(BEAMS, np.nan)
        results[probe.robot_id] = InfraredResult(counts_m2, model.range_errors_m(facings), unknown_m)

    session.for_each("infrared", write)
    second = _face_wall_with_each_sensor(session, "check of infrared", model.CHECK_SAMPLES, walls)
    for probe in session.active:
        after_m = model.range_errors_m(second[probe.robot_id])
        results[probe.robot_id] = results[probe.robot_id]._replace(after_m=after_m)


def _face_wall_with_each_sensor(
    session: Session, title: str, samples: int, walls: Dict[int, Pose]
) -> Dict[int, List[model.Facing]]:
    """Turn each sensor to the wall and collect its readings.

    walls: places of the robots, in their odom frames, and headings straight to the wall, stored at the first sensor.
    """
    facings: Dict[int, List[model.Facing]] = {probe.robot_id: [] for probe in session.active}
    for step in range(BEAMS):
        sensor = (model.FRONT - step) % BEAMS
        say("%s: sensor %s, %d of %d" % (title, BEAM_NAMES[sensor], step + 1, BEAMS))
        for probe in session.active:
            probe.forget_scans()
        session.wait_for(lambda: all(probe.count_scans() >= samples for probe in session.active), SCAN_TIMEOUT_S)

        def evaluate(probe: Probe, sensor: int = sensor) -> float:
            probe.check_alive(session.now_s)
            counts, ranges_m = probe.read_scans()
            pose = probe.pose
            facing = model.Facing(sensor, counts.tolist(), ranges_m.tolist(), 0.0)
            misalignment_rad = model.estimate_misalignment_rad(facing)
            wall = walls.setdefault(probe.robot_id, pose._replace(yaw_rad=pose.yaw_rad - misalignment_rad))
            moved_m = transform_pose(invert_pose(wall), pose).x_m
            facings[probe.robot_id].append(facing._replace(moved_m=moved_m))
            return pose.yaw_rad - misalignment_rad + model.BEAM_STEP_RAD

        _turn(session, title, session.for_each(title, evaluate))
    return facings


def _turn(session: Session, title: str, targets_rad: Dict[int, float]) -> None:
    """Turn every active robot on the spot to its heading, with further tries for the remainder."""

    def remaining_rad(probe: Probe) -> float:
        return math.remainder(targets_rad[probe.robot_id] - probe.pose.yaw_rad, 2.0 * math.pi)

    def have_turned(turning: Sequence[Probe]) -> bool:
        return all(abs(remaining_rad(probe)) <= TURN_REACHED_RAD for probe in turning)

    def check(probe: Probe) -> None:
        probe.check_alive(session.now_s)
        if abs(remaining_rad(probe)) > TURN_TOLERANCE_RAD:
            text = "could not turn on the spot: %.0f degrees are missing; calibrate its motors, or free its wheels"
            raise CalibrationError(text % abs(math.degrees(remaining_rad(probe))))

    for tolerance_rad in (0.0, *[TURN_TOLERANCE_RAD / 2.0] * (TURN_TRIES - 1)):
        turning = [probe for probe in session.active if abs(remaining_rad(probe)) > tolerance_rad]
        if not turning:
            break
        for probe in turning:
            probe.turn(remaining_rad(probe))
        session.pause(TURN_S / 4.0)
        session.wait_for(partial(have_turned, turning), TURN_S * 3.0 / 4.0)
        session.settle()
    session.for_each(title, check)
