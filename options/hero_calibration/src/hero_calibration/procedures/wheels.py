"""Procedure wheels: diameters of both wheels and the distance between them, by what the robots drive.

Robots drive a square to the left and one to the right, for errors of diameter and of distance bend one of them more and
the other one less. A camera tells where a robot is at each corner; with a tape measure the user tells where each square
ends, and how long a straight path is. Source: J. Borenstein, L. Feng, Measurement and Correction of Systematic Odometry
Errors in Mobile Robots (UMBmark), IEEE Transactions on Robotics and Automation 12, 1996; here by least squares.
"""

import math
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from hero_client.values import follow_wheels
from hero_node import Pose, invert_pose, say, transform_pose, wrap_angle
from hero_node.robot_constants import TICK_M, WHEEL_DIAMETER_M, WHEEL_SEPARATION_M

from ..errors import CalibrationError, EndedError
from ..robots.probe import Probe
from ..robots.session import COMMAND_PERIOD_S, Session
from .placement import Ask

ROOM = "Wheels: each robot drives squares of 30 cm to its left and right: give it 50 cm of room to all sides."

SPEED_M_S, SIDE_S = 0.1, 3.0
ANGULAR_RAD_S, CORNER_S = 1.5, math.pi / 2.0 / 1.5
STRAIGHT_S = 6.0
MEASURE_S = 0.6
TRIES = 2

CAMERA_SD = (0.001, 0.001, 0.005)
TAPE_SD = (0.002, 0.002, math.inf)
STRAIGHT_SD = (0.002, math.inf, math.inf)
"""Errors of a measured x, y (m) and yaw (rad); inf: not measured."""

MAX_CHANGE = 0.1
"""Wheels that differ more from the nominal ones are implausible: the robot slipped, or was moved by hand."""

MAX_DEVIATION_SD = 3.0
"""Deviation of the legs, rms, above which the wheels found are not those of the robot: an off-center tag reaches 9."""

NOMINAL_M = np.array((WHEEL_DIAMETER_M, WHEEL_DIAMETER_M, WHEEL_SEPARATION_M))

Sd = Tuple[float, float, float]

Drive = Tuple[float, float, float]
"""m/s, rad/s, s."""

Stop = Tuple[float, Dict[int, Optional[Pose]]]
"""Time (s), and the places of the robots that were tracked."""


class Leg(NamedTuple):
    """Motion of a robot between two stops, as measured in its frame at the first, and its wheels' ticks, (K, 2)."""

    ticks: np.ndarray
    moved: Pose
    sd: Sd = CAMERA_SD


class WheelResult(NamedTuple):
    """Diameters of the left and the right wheel and their distance (3,), m; deviations of the legs, in sd, rms."""

    wheels_m: np.ndarray
    before: float
    after: float

    def to_file(self) -> Dict[str, List[float]]:
        """Return what is kept in the robot's file."""
        return {"wheels_m": [round(float(length_m), 6) for length_m in self.wheels_m]}

    def describe(self) -> str:
        """Return the result as a line of text."""
        text = "diameters %.2f and %.2f mm, distance %.2f mm; paths differ by %.1f sd before, %.1f after"
        return text % (*(1e3 * self.wheels_m), self.before, self.after)


def follow_ticks(ticks: np.ndarray, wheels_m: np.ndarray) -> Pose:
    """Return where ticks (K, 2) lead a robot with these wheels (3,) from 0, 0, 0."""
    rolled_m = ticks * (TICK_M / WHEEL_DIAMETER_M * wheels_m[:2])
    x_m, y_m, yaw_rad = follow_wheels(rolled_m, wheels_m[2])[-1].tolist()
    return Pose(x_m, y_m, wrap_angle(yaw_rad))


def fit_wheels(legs: Sequence[Leg]) -> WheelResult:
    """Return the wheels that explain the legs best. Raises: CalibrationError for implausible ones."""

    def measure_deviations(scales: np.ndarray) -> np.ndarray:
        deviations = []
        for leg in legs:
            x_m, y_m, yaw_rad = follow_ticks(leg.ticks, NOMINAL_M * scales)
            off = (x_m - leg.moved.x_m, y_m - leg.moved.y_m, wrap_angle(yaw_rad - leg.moved.yaw_rad))
            deviations.append(np.divide(off, leg.sd))
        return np.concatenate(deviations)

    scales = np.ones(3)
    before = measure_deviations(scales)
    for _ in range(5):
        here = measure_deviations(scales)
        steps = 1e-4 * np.eye(3)
        jacobian = np.column_stack([(measure_deviations(scales + step) - here) / 1e-4 for step in steps])
        scales = scales - np.linalg.lstsq(jacobian, here, rcond=None)[0]
    if not (np.abs(scales - 1.0) < MAX_CHANGE).all():
        found_mm = "%.1f, %.1f and %.1f mm" % tuple(1e3 * NOMINAL_M * scales)
        raise CalibrationError(f"wheels and distance would be {found_mm}: did it slip, or was it touched?")
    rms = [float(np.sqrt(np.mean(np.square(values)))) for values in (before, measure_deviations(scales))]
    if rms[1] > MAX_DEVIATION_SD:
        text = "no wheels explain its paths (%.1f sd): did it slip, or is its tag off-center (calibrate_camera robots)?"
        raise CalibrationError(text % rms[1])
    return WheelResult(NOMINAL_M * scales, *rms)


def calibrate_wheels(session: Session, ask: Optional[Ask], results: Dict[int, WheelResult]) -> None:
    """Calibrate all active robots; put the results by robot into results as they are found.

    ask: asks for what the user measures with a tape; None: localize tells where robots are.
    """
    if ask is not None:
        _drive_for_tape(session, ask, results)
        return
    say("wheels: squares to the left and to the right, about 1 min")

    def drive(probes: Sequence[Probe]) -> List[Stop]:
        stops = [_stop_and_look(session)]
        for part in [*_list_square(1.0), *_list_square(-1.0)]:
            _drive(session, probes, part)
            stops.append(_stop_and_look(session))
        return stops

    def evaluate(probe: Probe, stops: List[Stop], _is_last: bool) -> WheelResult:
        legs = []
        for (start_s, starts), (end_s, ends) in zip(stops, stops[1:]):
            start, end = starts[probe.robot_id], ends[probe.robot_id]
            if start is None or end is None:
                raise CalibrationError("localize does not track it: is its tag in view? Or measure by --tape")
            legs.append(Leg(_take_ticks(probe, start_s, end_s), transform_pose(invert_pose(start), end)))
        return fit_wheels(legs)

    session.repeat("wheels", TRIES, drive, evaluate, results)


def _list_square(side: float) -> List[Drive]:
    return [(SPEED_M_S, 0.0, SIDE_S), (0.0, side * ANGULAR_RAD_S, CORNER_S)] * 4


def _drive(session: Session, probes: Sequence[Probe], part: Drive) -> None:
    linear_m_s, angular_rad_s, duration_s = part
    end_s = session.now_s + duration_s
    while session.now_s < end_s:
        for probe in probes:
            probe.drive(angular_rad_s, linear_m_s)
        session.pause(min(COMMAND_PERIOD_S, max(0.0, end_s - session.now_s)))
    session.settle()


def _stop_and_look(session: Session) -> Stop:
    session.pause(MEASURE_S)
    now_s = session.now_s
    return now_s, {probe.robot_id: probe.find_place(now_s - MEASURE_S / 2.0) for probe in session.probes}


def _take_ticks(probe: Probe, start_s: float, end_s: float) -> np.ndarray:
    """Return the ticks (K, 2) from one stop to another. Raises: CalibrationError if readings are missing."""
    readings = probe.read_wheels()
    kept = (readings.heard_s > start_s - MEASURE_S / 2.0) & (readings.heard_s <= end_s)
    if kept.sum() < 2:
        raise CalibrationError("no encoder readings came: is the network busy? try again")
    return np.column_stack((readings.left_ticks, readings.right_ticks))[kept]


def _drive_for_tape(session: Session, ask: Ask, results: Dict[int, WheelResult]) -> None:
    """Drive robots while the user measures."""
    legs: Dict[int, List[Leg]] = {probe.robot_id: [] for probe in session.active}
    parts = (
        ("straight ahead", [(SPEED_M_S, 0.0, STRAIGHT_S)], STRAIGHT_SD),
        ("a square to the left", _list_square(1.0), TAPE_SD),
        ("a square to the right", _list_square(-1.0), TAPE_SD),
    )
    for name, drives, sd in parts:
        if ask(f"Mark center and heading of each robot for {name}; then Enter, q to end: ") == "q":
            raise EndedError
        start_s = session.now_s
        for drive in drives:
            _drive(session, session.active, drive)
        session.pause(MEASURE_S)
        end_s = session.now_s

        def measure(probe: Probe, times_s: Tuple[float, float] = (start_s, end_s), sd: Sd = sd) -> None:
            legs[probe.robot_id].append(_ask_for_leg(ask, *times_s, sd, probe))
            if len(legs[probe.robot_id]) == len(parts):
                results[probe.robot_id] = fit_wheels(legs[probe.robot_id])

        for probe in session.active:  # one after another: there is one terminal
            session.for_each("wheels", measure, [probe])


def _ask_for_leg(ask: Ask, start_s: float, end_s: float, sd: Sd, probe: Probe) -> Leg:
    wanted = 1 if math.isinf(sd[1]) else 2
    what = "ahead" if wanted == 1 else "ahead and to the left, such as 12 -5"
    question = f"{probe.name}: mm from its mark, {what}: "
    while True:
        words = ask(question).replace(",", " ").split()
        try:
            x_m, y_m, *_ = [float(word) / 1e3 for word in words] + [0.0] * (2 - wanted)
        except ValueError:
            continue  # asked again
        return Leg(_take_ticks(probe, start_s, end_s), Pose(x_m, y_m, 0.0), sd)
