"""Calibrates all robots of a session part by part, keeps what was measured, and prints a table. Knows no ROS."""

import time
from typing import Any, Dict, List, Optional, Sequence

from hero_node import say
from hero_node.files import KeptCalibration

from . import store
from .errors import EndedError
from .procedures.infrared import calibrate_infrared
from .procedures.motors import calibrate_motors
from .procedures.placement import Ask, place_robots
from .procedures.velocity import calibrate_velocity
from .procedures.wheels import ROOM, calibrate_wheels
from .robots.probe import Probe
from .robots.session import Session

MOTORS, VELOCITY, INFRARED, WHEELS = "motors", "velocity", "infrared", "wheels"
DEFAULT_PARTS = (MOTORS, VELOCITY, INFRARED)
PARTS = (*DEFAULT_PARTS, WHEELS)

ENDED = 130
"""Exit status of a program that Ctrl-C or the user ended."""


def calibrate_parts(
    session: Session, parts: Sequence[str], folder: str, ask: Optional[Ask], tape: Optional[Ask] = None
) -> int:
    """Calibrate parts of PARTS, save files in folder, and print a table; return the exit code.

    ask: None if the robots are placed already; tape: asks for what is measured with a tape, None: localize tells where
    robots are. Raises: CalibrationError.
    """
    results: Dict[str, Dict[int, Any]] = {part: {} for part in PARTS}
    lines: List[str] = []
    ended = False
    try:
        _calibrate(session, parts, ask, tape, results)
    except EndedError:
        ended = True
    finally:
        session.stop()
        # Robots hold what was measured before the end, whatever caused it: the files must, too.
        for probe in session.probes:
            found = {part: by_robot[probe.robot_id] for part, by_robot in results.items() if probe.robot_id in by_robot}
            path = _save(probe, folder, found) if found else ""
            outcome = "ok" if found else "not measured"
            lines.append(f"{probe.name}: {'FAILED: ' + probe.failure if probe.failure else outcome}")
            lines += [f"  {part:9} {result.describe()}" for part, result in found.items()]
            lines += ["  " + path] if path else []
    say("\n" + "\n".join(lines))
    if ended:
        say("ended early: robots hold what the table shows, and keep the rest")
        return ENDED
    return 1 if any(probe.failure for probe in session.probes) else 0


def _calibrate(
    session: Session, parts: Sequence[str], ask: Optional[Ask], tape: Optional[Ask], results: Dict[str, Dict[int, Any]]
) -> None:
    if MOTORS in parts or VELOCITY in parts:
        place_robots(session, at_wall=False, ask=ask)
    if MOTORS in parts and session.active:
        calibrate_motors(session, results[MOTORS])
    if VELOCITY in parts and session.active:
        calibrate_velocity(session, results[MOTORS], results[VELOCITY])
    if WHEELS in parts and session.active:
        say(ROOM)
        place_robots(session, at_wall=False, ask=ask)
        calibrate_wheels(session, tape, results[WHEELS])
    if INFRARED in parts and session.active:
        place_robots(session, at_wall=True, ask=ask)
        calibrate_infrared(session, results[INFRARED])


def _save(probe: Probe, folder: str, results: Dict[str, Any]) -> str:
    """Write a robot's file; return its path, empty if that failed."""
    path = store.name_file(folder, probe.robot_id)
    values = {key: numbers for result in results.values() for key, numbers in result.to_file().items()}
    date = time.strftime("%Y-%m-%d %H:%M:%S")
    try:
        store.save(path, KeptCalibration(probe.robot_id, date, values, {"model": probe.model}))
    except OSError as error:
        probe.failure = probe.failure or f"{path} cannot be written: {error.strerror}"
        return ""
    return path
