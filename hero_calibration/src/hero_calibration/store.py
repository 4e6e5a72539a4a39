"""Keeps the calibration of a robot in a YAML file, from which it can be restored. Pure but for the files."""

import math
import os
import re
from contextlib import suppress
from typing import Any, Dict, List, NamedTuple, Optional, Tuple

import yaml

from .errors import CalibrationError

PREVIOUS = ".previous"
"""Goes before the suffix of the previous file."""

LONGEST_SHOWN = 60

Range = Tuple[int, float, float, str]

SETTINGS: Dict[str, Range] = {
    "motor_centers_us": (2, 1200.0, 1800.0, "left, right"),
    "velocity_gains": (6, 0.0, 1e5, "P I D of the left wheel, then of the right"),
    "infrared_counts_m2": (8, 1e-3, 100.0, "by index of proximity"),
}
"""What can be written to the robot: how many numbers, the lowest and the highest allowed, and their meaning."""

RESULTS: Dict[str, Range] = {
    "dead_zones_us": (4, 0.0, 3000.0, "edges of the left wheel, then of the right"),
    "velocity_errors": (2, 0.0, 100.0, "before, after"),
    "range_errors_before_m": (8, -10.0, 10.0, "by index of proximity"),
    "range_errors_after_m": (8, -10.0, 10.0, "by index of proximity"),
}
"""The same for what the user may want to look up; a number may be .nan: unknown."""


class Calibration(NamedTuple):
    """The file of one robot: N of hero_N, date as text, and numbers by key of SETTINGS and RESULTS."""

    robot_id: int
    date: str
    values: Dict[str, List[float]]


def name_file(folder: str, robot_id: int) -> str:
    """Return the path of a robot's file."""
    return os.path.join(folder, "hero_%d.yaml" % robot_id)


def list_files(folder: str) -> List[str]:
    """Return the paths of all robots' files in a folder, which may not exist."""
    names = sorted(os.listdir(folder)) if os.path.isdir(folder) else []
    return [os.path.join(folder, name) for name in names if name.endswith(".yaml") and PREVIOUS not in name]


def save(path: str, calibration: Calibration) -> None:
    """Write a file; the previous one is kept beside it, and its values that were not measured again stay.

    A damaged previous file, or one of another robot, does not prevent the new one.

    Raises: CalibrationError.
    """
    base, suffix = os.path.splitext(path)
    values = calibration.values
    try:
        if os.path.exists(path):
            with open(path, "rb") as file:
                _write_atomically(base + PREVIOUS + suffix, file.read())
            with suppress(CalibrationError):
                old = load(path)
                values = {**old.values, **values} if old.robot_id == calibration.robot_id else values
        content = {"robot": "hero_%d" % calibration.robot_id, "date": calibration.date, **values}
        text: str = yaml.safe_dump(content, sort_keys=False, default_flow_style=None)
        _write_atomically(path, text.encode())
    except OSError as error:
        raise CalibrationError("%s cannot be written: %s" % (path, error.strerror)) from error


def _write_atomically(path: str, content: bytes) -> None:
    """Write a file: whenever power fails, path is the old one or the new one, complete. Raises: OSError."""
    written = "%s.%d.new" % (path, os.getpid())
    try:
        with open(written, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(written, path)
    except OSError:
        with suppress(OSError):
            os.remove(written)
        raise
    folder = os.open(os.path.dirname(path) or ".", os.O_RDONLY)
    try:
        os.fsync(folder)  # the name itself
    finally:
        os.close(folder)


def load(path: str) -> Calibration:
    """Read a file. Raises: CalibrationError with file, line, value and what is allowed."""
    root = _parse(path)
    if root is None or root.id != "mapping":
        raise _fail_at(path, root, "is no calibration: it must begin with robot: hero_N")
    nodes: Dict[str, Any] = {}
    known = {**SETTINGS, **RESULTS}
    for key_node, value_node in root.value:
        if key_node.value not in ("robot", "date", *known):
            allowed = ", ".join(("robot", "date", *known))
            raise _fail_at(path, key_node, "unknown key %s; known are %s" % (_describe(key_node), allowed))
        if key_node.value in nodes:
            raise _fail_at(path, key_node, "key %s is there twice" % _describe(key_node))
        nodes[key_node.value] = value_node
    robot = nodes.get("robot", root)
    match = re.fullmatch(r"hero_([0-9]{1,9})", robot.value) if robot.id == "scalar" else None
    if match is None:
        raise _fail_at(path, robot, "robot must be hero_N, not %s" % _describe(robot))
    date = nodes.get("date")
    if date is not None and (date.id != "scalar" or not date.value.isprintable()):  # it is printed in terminals
        raise _fail_at(path, date, "date must be one line of text, not %s" % _describe(date))
    values = {key: _read_numbers(path, key, nodes[key], known[key]) for key in known if key in nodes}
    return Calibration(int(match.group(1)), date.value if date is not None else "", values)


def _parse(path: str) -> Any:
    """Return the root node of a YAML file, None if it is empty; nodes know their lines."""
    try:
        with open(path, encoding="utf-8") as file:
            text = file.read()
        return yaml.compose(text, Loader=yaml.SafeLoader)
    except OSError as error:
        raise CalibrationError("%s cannot be read: %s" % (path, error.strerror)) from error
    except yaml.MarkedYAMLError as error:
        raise _fail(path, error.problem_mark.line, str(error.problem)) from error
    except yaml.reader.ReaderError as error:
        reason = "the character U+%04X may not stand in a YAML file" % error.character
        raise _fail(path, text.count("\n", 0, error.position), reason) from error
    except (UnicodeDecodeError, RecursionError) as error:
        raise _fail(path, 0, "is no text of a calibration: %s" % error) from error


def _read_numbers(path: str, key: str, node: Any, allowed: Range) -> List[float]:
    count, low, high, meaning = allowed
    text = "%d numbers from %g to %g (%s)" % (count, low, high, meaning)
    if node.id != "sequence" or len(node.value) != count:
        raise _fail_at(path, node, "%s must be %s" % (key, text))
    numbers = []
    for item in node.value:
        number = _read_number(item)
        if number is None or not (low <= number <= high or (math.isnan(number) and key in RESULTS)):
            raise _fail_at(path, item, "%s holds %s, but must be %s" % (key, _describe(item), text))
        numbers.append(number)
    return numbers


def _read_number(node: Any) -> Optional[float]:
    """Return the number that a node holds, None if it holds none."""
    if node.id != "scalar":
        return None
    if node.value == ".nan":
        return math.nan
    try:
        return float(node.value)
    except ValueError:
        return None


def _describe(node: Any) -> str:
    """Return the content of a node for an error; a list may even contain itself."""
    if node.id != "scalar":
        return "a " + str(node.id)
    return repr(str(node.value)[:LONGEST_SHOWN])


def _fail_at(path: str, node: Any, reason: str) -> CalibrationError:
    return _fail(path, node.start_mark.line if node is not None else 0, reason)


def _fail(path: str, line: int, reason: str) -> CalibrationError:
    """Return the error of a line, counted from 0."""
    return CalibrationError("%s:%d: %s; correct the file, or move it away" % (path, line + 1, reason))
