"""Keeps the calibration of a robot in a YAML file, from which it can be restored. Pure but for the files."""

import math
import os
import re
from contextlib import suppress
from typing import Any, Dict, List, NamedTuple, Tuple

from hero_node.number_checks import is_number
from hero_node.safe_file import lock_file, write_file
from hero_node.texts import make_printable, shorten
from hero_node.yaml_edit import replace_values
from hero_node.yaml_text import YamlError, parse_yaml, read_text

from .errors import CalibrationError

PREVIOUS = ".previous"
"""Goes before the suffix of the previous file."""

Range = Tuple[int, float, float, str]

SETTINGS: Dict[str, Range] = {
    "motor_centers_us": (2, 1200.0, 1800.0, "left, right"),
    "velocity_gains": (6, 0.0, 1e5, "P I D of the left wheel, then of the right"),
    "infrared_counts_m2": (8, 1e-3, 100.0, "by index of proximity"),
}
"""Settings of a robot: number of values, limits, meaning."""

RESULTS: Dict[str, Range] = {
    "wheels_m": (3, 0.01, 1.0, "diameters of the left and the right wheel, distance between them"),
    "dead_zones_us": (4, 0.0, 3000.0, "edges of the left wheel, then of the right"),
    "velocity_errors": (2, 0.0, 100.0, "before, after"),
    "range_errors_before_m": (8, -10.0, 10.0, "by index of proximity"),
    "range_errors_after_m": (8, -10.0, 10.0, "by index of proximity"),
}
"""The same for what the user may want to look up; a number may be .nan: unknown."""

OTHERS = ("model", "ticks_per_turn")
"""Keys that the driver reads and checks, too: the model of the robot, and ticks that were entered by hand."""


class KeptCalibration(NamedTuple):
    """The file of one robot: N of hero_N, date as text, numbers by key of SETTINGS and RESULTS, values of OTHERS."""

    robot_id: int
    date: str
    values: Dict[str, List[float]]
    others: Dict[str, Any] = {}


def name_file(folder: str, robot_id: int) -> str:
    """Return the path of a robot's file."""
    return os.path.join(folder, "hero_%d.yaml" % robot_id)


def make_folder(folder: str) -> None:
    """Create a folder unless it exists. Raises: CalibrationError."""
    try:
        os.makedirs(folder, exist_ok=True)
    except OSError as error:
        raise CalibrationError(f"{folder} cannot be created: {error.strerror}") from error


def list_files(folder: str) -> List[str]:
    """Return the paths of all robots' files in a folder, which may not exist."""
    names = sorted(os.listdir(folder)) if os.path.isdir(folder) else []
    return [os.path.join(folder, name) for name in names if name.endswith(".yaml") and PREVIOUS not in name]


def save(path: str, calibration: KeptCalibration) -> None:
    """Write a file; the previous one is kept beside it. Its comments and values that were not measured again stay.

    A damaged previous file, or one of another robot or model, does not prevent the new one.

    Raises: CalibrationError.
    """
    base, suffix = os.path.splitext(path)
    values, others, text = calibration.values, calibration.others, ""
    try:
        with lock_file(path):
            if os.path.exists(path):
                with open(path, "rb") as file:
                    write_file(base + PREVIOUS + suffix, file.read())
                with suppress(CalibrationError):
                    old = load(path)
                    is_same_model = old.others.get("model", others.get("model")) == others.get("model")
                    if old.robot_id == calibration.robot_id and is_same_model:
                        values, others, text = {**old.values, **values}, {**old.others, **others}, read_text(path)
            content = {"robot": "hero_%d" % calibration.robot_id, "date": calibration.date, **others, **values}
            write_file(path, replace_values(text, content).encode())
    except OSError as error:
        raise CalibrationError(f"{path} cannot be written: {error.strerror}") from error


def load(path: str) -> KeptCalibration:
    """Read a file. Raises: CalibrationError with file, key, value and what is allowed."""
    try:
        content = parse_yaml(read_text(path))
    except OSError as error:
        raise CalibrationError(f"{path} cannot be read: {error.strerror}") from error
    except YamlError as error:
        raise _refuse(path, f"is no calibration: {error}") from error
    if not isinstance(content, dict) or "robot" not in content:
        raise _refuse(path, "is no calibration: it needs a line robot: hero_N")
    known = {**SETTINGS, **RESULTS}
    for key in content:
        if key not in ("robot", "date", *OTHERS, *known):
            names = ", ".join(("robot", "date", *OTHERS, *known))
            raise _refuse(path, f"unknown key {shorten(key)}; known are {names}")
    match = re.fullmatch(r"hero_([0-9]{1,9})", str(content["robot"]))
    if match is None:
        raise _refuse(path, f"robot must be hero_N, not {shorten(content['robot'])}")
    values = {key: _read_numbers(path, key, content[key], allowed) for key, allowed in known.items() if key in content}
    others = {key: content[key] for key in OTHERS if key in content}
    return KeptCalibration(int(match.group(1)), make_printable(str(content.get("date", ""))), values, others)


def _read_numbers(path: str, key: str, found: Any, allowed: Range) -> List[float]:
    count, low, high, meaning = allowed
    text = "%s must be %d numbers from %g to %g (%s)" % (key, count, low, high, meaning)
    if not isinstance(found, list) or len(found) != count:
        raise _refuse(path, f"{text}, not {shorten(found)}")
    for number in found:
        is_unknown = key in RESULTS and isinstance(number, float) and math.isnan(number)
        if not is_unknown and not is_number(number, low, high):
            raise _refuse(path, f"{text}, not {shorten(number)}")
    return [float(number) for number in found]


def _refuse(path: str, reason: str) -> CalibrationError:
    return CalibrationError(f"{path}: {make_printable(reason)}; correct the file, or move it away")
