"""Files of `calibrate`, hero_N.yaml: their schema, and a folder of them. Knows no ROS.

One damaged file leaves its robot uncalibrated, and is told of; it never keeps the others' from being read.
"""

import math
import os
import re
from typing import Any, Dict, List, NamedTuple

from .errors import HeroError
from .number_checks import is_number
from .texts import make_printable, shorten
from .yaml_text import YamlError, parse_yaml, read_text

STOCK, HERO_PLUS = "hero", "hero_plus"
"""Models of the robot."""

PREVIOUS = ".previous"
"""Goes before the suffix of the file that a newer one has replaced."""


class CalibrationFileError(HeroError):
    """A file or folder cannot be used; the text says why and what to do. robot: hero_N, empty if it is not known."""

    def __init__(self, text: str, robot: str = "") -> None:
        super().__init__(text)
        self.robot = robot


class Numbers(NamedTuple):
    """A list of numbers in a file."""

    length: int
    low: float
    high: float
    meaning: str
    may_be_unknown: bool = False  # a number may be .nan


SETTINGS = {
    "motor_centers_us": Numbers(2, 1200.0, 1800.0, "left, right"),
    "velocity_gains": Numbers(6, 0.0, 1e5, "P I D of the left wheel, then of the right"),
    "infrared_counts_m2": Numbers(8, 1e-3, 100.0, "by index of proximity"),
}
"""Settings in a robot's flash."""

RESULTS = {
    "wheels_m": Numbers(3, 0.01, 1.0, "diameters of the left and the right wheel, distance between them"),
    "dead_zones_us": Numbers(4, 0.0, 3000.0, "edges of the left wheel, then of the right"),
    "velocity_errors": Numbers(2, 0.0, 100.0, "before, after", may_be_unknown=True),
    "range_errors_before_m": Numbers(8, -10.0, 10.0, "by index of proximity", may_be_unknown=True),
    "range_errors_after_m": Numbers(8, -10.0, 10.0, "by index of proximity", may_be_unknown=True),
}
"""Results that programs use, or that the user may want to look up."""

OTHERS = ("model", "ticks_per_turn")
"""Model of the robot, and ticks per turn of a wheel that were entered by hand."""

MODELS = ("", STOCK, HERO_PLUS)
"""Values of model; empty: not known."""


class KeptCalibration(NamedTuple):
    """The file of one robot: N of hero_N, date as text, numbers by key of SETTINGS and RESULTS, values of OTHERS."""

    robot_id: int
    date: str
    values: Dict[str, List[float]]
    others: Dict[str, Any] = {}


class Calibrations(NamedTuple):
    """A folder: what can be used, and why the rest cannot, both by names of robots such as hero_3.

    A file that does not say whose it is has its own name in problems, a folder that cannot be read an empty one.
    """

    found: Dict[str, KeptCalibration]
    problems: Dict[str, str]


def list_files(folder: str) -> List[str]:
    """Return the paths of all robots' files in a folder, which may not exist. Raises: CalibrationFileError."""
    folder = os.path.expanduser(folder)
    try:
        names = sorted(os.listdir(folder)) if os.path.isdir(folder) else []
    except OSError as error:
        raise CalibrationFileError(f"{folder} cannot be read: {error.strerror}; correct its permissions") from error
    names = [name for name in names if re.fullmatch(r"hero_.*\.yaml", name) and PREVIOUS not in name]
    return [os.path.join(folder, name) for name in names]


def read_calibrations(folder: str) -> Calibrations:
    """Return what the files of a folder hold (empty: none). Of a robot with several files, none is used."""
    found: Dict[str, KeptCalibration] = {}
    problems: Dict[str, str] = {}
    try:
        paths = list_files(folder) if folder else []
    except CalibrationFileError as error:
        return Calibrations({}, {"": str(error)})
    for path in paths:
        try:
            kept = read_calibration(path)
        except CalibrationFileError as error:
            problems[error.robot or os.path.splitext(os.path.basename(path))[0]] = str(error)
            continue
        name = "hero_%d" % kept.robot_id
        if name in found:
            problems[name] = f"{path}: another file is for {name}, too; move one of them away"
        found[name] = kept
    return Calibrations({name: kept for name, kept in found.items() if name not in problems}, problems)


def read_calibration(path: str) -> KeptCalibration:
    """Read a file. Raises: CalibrationFileError with file, key, value and what is allowed."""
    try:
        content = parse_yaml(read_text(path))
    except OSError as error:
        raise _refuse(path, f"cannot be read: {error.strerror}") from error
    except YamlError as error:
        raise _refuse(path, f"is no calibration: {error}") from error
    if not isinstance(content, dict) or "robot" not in content:
        raise _refuse(path, "is no calibration: it needs a line robot: hero_N")
    match = re.fullmatch(r"hero_([0-9]{1,9})", str(content["robot"]))
    if match is None:
        raise _refuse(path, f"robot must be hero_N, not {shorten(content['robot'])}")
    robot_id = int(match.group(1))
    try:
        values, others = _check(content)
    except ValueError as error:
        raise _refuse(path, str(error), "hero_%d" % robot_id) from error
    return KeptCalibration(robot_id, make_printable(str(content.get("date", ""))), values, others)


def _check(content: Dict[Any, Any]) -> Any:
    """Return numbers and others of a file's content. Raises: ValueError."""
    known = {**SETTINGS, **RESULTS}
    for key in content:
        if key not in ("robot", "date", *OTHERS, *known):
            names = ", ".join(("robot", "date", *OTHERS, *known))
            raise ValueError(f"unknown key {shorten(key)}; known are {names}")
    values = {key: _check_numbers(key, content[key], allowed) for key, allowed in known.items() if key in content}
    others = {key: content[key] for key in OTHERS if key in content}
    ticks_per_turn, model = others.get("ticks_per_turn"), others.get("model", "")
    if ticks_per_turn is not None and not is_number(ticks_per_turn, 1.0, 1e6):
        raise ValueError(f"ticks_per_turn must be a number from 1 to 1000000, not {shorten(ticks_per_turn)}")
    if model not in MODELS:
        raise ValueError(f"model must be {STOCK} or {HERO_PLUS}, not {shorten(model)}")
    return values, others


def _check_numbers(key: str, found: Any, allowed: Numbers) -> List[float]:
    text = "%s must be %d numbers from %g to %g (%s)" % (key, *allowed[:4])
    if not isinstance(found, list) or len(found) != allowed.length:
        raise ValueError(f"{text}, not {shorten(found)}")
    for number in found:
        is_unknown = allowed.may_be_unknown and isinstance(number, float) and math.isnan(number)
        if not is_unknown and not is_number(number, allowed.low, allowed.high):
            raise ValueError(f"{text}, not {shorten(number)}")
    return [float(number) for number in found]


def _refuse(path: str, reason: str, robot: str = "") -> CalibrationFileError:
    return CalibrationFileError(f"{path}: {make_printable(reason)}; correct the file, or move it away", robot)
