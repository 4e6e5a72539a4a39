"""What was measured of a robot -> a YAML file, and back. A file can be written into the robot again (restore).

Pure but for the files.
"""

import math
import os
import re
import time
from contextlib import suppress
from typing import Any, Dict, List, NamedTuple, Optional, Tuple

import yaml

from hero_sim.errors import OptionError
from hero_sim.yaml_file import describe_node, fail_at, read_mapping, read_nodes

from .errors import CalibrationError

PREVIOUS = ".previous"
"""Goes before the suffix of the file that was there before."""

DAMAGED = ".damaged"
"""The same for a file that could not be read when a new one was written."""

RESULT_DEPTH = 2
RESULT_LENGTH = 8
"""Results are lists of at most one number per sensor, or one pair per wheel."""

_RANGES: Dict[str, Tuple[int, float, float, str]] = {
    "motor_centres_us": (2, 1200.0, 1800.0, "left, right"),
    "velocity_gains": (6, 0.0, 1e5, "P I D of the left wheel, then of the right"),
    "infrared_counts_m2": (8, 1e-3, 100.0, "by index of proximity"),
}


class Calibration(NamedTuple):
    """What is kept of one robot; None for what was not measured.

    Attributes:
        robot_id: N of hero_N.
        date: when, in words.
        motor_centres_us: left, right.
        velocity_gains: lkp lki lkd rkp rki rkd.
        infrared_counts_m2: one per sensor.
        results: how far off the robot was before and after, for people.
    """

    robot_id: int
    date: str = ""
    motor_centres_us: Optional[List[int]] = None
    velocity_gains: Optional[List[float]] = None
    infrared_counts_m2: Optional[List[float]] = None
    results: Optional[Dict[str, Any]] = None

    @property
    def is_empty(self) -> bool:
        """Whether it holds nothing that a robot could be given."""
        return (
            self.motor_centres_us is None and self.velocity_gains is None and self.infrared_counts_m2 is None
        )


def name_file(folder: str, robot_id: int) -> str:
    """Return the path of a robot's file."""
    return os.path.join(folder, "hero_%d.yaml" % robot_id)


def save(path: str, calibration: Calibration) -> Optional[str]:
    """Write a file; what it held of other parts stays, and the old file is kept beside it.

    A damaged old file does not keep the new one from being written; returned is the name under which it is kept,
    None if there was none.

    Raises: CalibrationError.
    """
    base, suffix = os.path.splitext(path)
    damaged = None
    try:
        if os.path.lexists(path):
            try:
                calibration = _merge(load(path), calibration)
                with open(path, "rb") as file:
                    _write_whole(base + PREVIOUS + suffix, file.read())
            except CalibrationError:
                damaged = base + DAMAGED + time.strftime("-%Y%m%d-%H%M%S") + suffix
                os.rename(path, damaged)
        content = {"robot": "hero_%d" % calibration.robot_id}
        content.update(
            {
                key: value
                for key, value in calibration._asdict().items()
                if key != "robot_id" and value is not None
            }
        )
        text: str = yaml.safe_dump(content, sort_keys=False, default_flow_style=None)
        _write_whole(path, text.encode())
    except OSError as error:
        raise CalibrationError("%s cannot be written: %s" % (path, error.strerror)) from error
    return damaged


def _merge(old: Calibration, new: Calibration) -> Calibration:
    if old.robot_id != new.robot_id:
        raise CalibrationError("it is a file of hero_%d" % old.robot_id)
    merged = {
        key: value for key, value in old._asdict().items() if getattr(new, key) is None and value is not None
    }
    results = {**(old.results or {}), **(new.results or {})}
    return new._replace(**merged)._replace(results=results or None)


def _write_whole(path: str, content: bytes) -> None:
    """Write a file so that path leads to the old one or the new one, whole, whenever power fails. Raises: OSError."""
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
    """Read a file. Raises: CalibrationError with file, line, reason and what is allowed."""
    try:
        return _read(path)
    except OptionError as error:
        raise CalibrationError("%s; correct the file, or move it away" % error) from error


def _read(path: str) -> Calibration:
    root = read_nodes(path, path, "is it a file of calibrate, readable by you?")
    entries = read_mapping(path, root, "is no calibration: it must begin with robot: hero_N")
    known = ("robot", "date", "results", *_RANGES)
    for key, (key_node, _) in entries.items():
        if key not in known:
            raise fail_at(path, key_node, "unknown key %s; known are %s" % (describe_node(key_node), ", ".join(known)))
    nodes = {key: value_node for key, (_, value_node) in entries.items()}
    name = _read_text(path, nodes.get("robot", root), "robot must be hero_N")
    match = re.fullmatch(r"hero_([0-9]{1,9})", name)
    if match is None:
        raise fail_at(path, nodes.get("robot", root), "robot must be hero_N, not %r" % name[:60])
    values = {key: _read_numbers(path, key, nodes[key]) for key in _RANGES if key in nodes}
    centres = values.get("motor_centres_us")
    return Calibration(
        int(match.group(1)),
        _read_text(path, nodes["date"], "date must be one line of text") if "date" in nodes else "",
        None if centres is None else [int(round(centre)) for centre in centres],
        values.get("velocity_gains"),
        values.get("infrared_counts_m2"),
        _read_results(path, nodes["results"]) if "results" in nodes else None,
    )


def _read_text(path: str, node: Any, what: str) -> str:
    # It is printed in terminals.
    if node.id != "scalar" or not str(node.value).isprintable():
        raise fail_at(path, node, "%s, not %s" % (what, describe_node(node)))
    return str(node.value)


def _read_number(node: Any) -> float:
    """Return the number that a node holds, NaN if it holds none."""
    try:
        return float(node.value) if node.id == "scalar" else math.nan
    except ValueError:
        return math.nan


def _read_numbers(path: str, key: str, node: Any) -> List[float]:
    count, low, high, meaning = _RANGES[key]
    allowed = "%d numbers from %g to %g (%s)" % (count, low, high, meaning)
    if node.id != "sequence" or len(node.value) != count:
        raise fail_at(path, node, "%s must be %s" % (key, allowed))
    numbers = [_read_number(item) for item in node.value]
    for item, number in zip(node.value, numbers):
        if not low <= number <= high:
            raise fail_at(path, item, "%s holds %s, but must be %s" % (key, describe_node(item), allowed))
    return numbers


def _read_results(path: str, node: Any) -> Dict[str, Any]:
    what = "results must be keys with a number each, or a list of numbers"
    results: Dict[str, Any] = {}
    for key, (key_node, value_node) in read_mapping(path, node, what).items():
        _read_text(path, key_node, what)
        results[key] = _read_result(path, value_node, what, RESULT_DEPTH)
    return results


def _read_result(path: str, node: Any, what: str, depth: int) -> Any:
    if node.id == "sequence" and depth and len(node.value) <= RESULT_LENGTH:
        return [_read_result(path, item, what, depth - 1) for item in node.value]
    number = _read_number(node)
    # What could not be measured before is kept as .nan, which YAML spells with a dot and Python without.
    if node.id != "scalar" or not (math.isfinite(number) or node.value == ".nan"):
        raise fail_at(path, node, "%s, not %s" % (what, describe_node(node)))
    return number
