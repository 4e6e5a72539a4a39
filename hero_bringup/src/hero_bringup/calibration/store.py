"""What was measured of a robot -> a YAML file, and back. A file can be written into the robot again (restore).

Pure but for the files.
"""

import math
import os
from typing import Any, Dict, List, NamedTuple, Optional, Tuple

import yaml

from .errors import CalibrationError

PREVIOUS = ".previous"
"""Goes before the suffix of the file that was there before."""

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


def save(path: str, calibration: Calibration) -> None:
    """Write a file; what it held of other parts stays, and the old file is kept beside it.

    Raises: CalibrationError.
    """
    if os.path.exists(path):
        old = load(path)
        merged = {
            key: value
            for key, value in old._asdict().items()
            if getattr(calibration, key) is None and value is not None
        }
        results = {**(old.results or {}), **(calibration.results or {})}
        calibration = calibration._replace(**merged)._replace(results=results or None)
    content = {"robot": "hero_%d" % calibration.robot_id}
    content.update(
        {
            key: value
            for key, value in calibration._asdict().items()
            if key != "robot_id" and value is not None
        }
    )
    try:
        with open(path + ".new", "w", encoding="utf-8") as file:
            yaml.safe_dump(content, file, sort_keys=False, default_flow_style=None)
        if os.path.exists(path):
            base, suffix = os.path.splitext(path)
            os.replace(path, base + PREVIOUS + suffix)
        os.replace(path + ".new", path)
    except OSError as error:
        raise CalibrationError("%s cannot be written: %s" % (path, error.strerror)) from error


def load(path: str) -> Calibration:
    """Read a file. Raises: CalibrationError with the key and what is allowed."""
    try:
        with open(path, encoding="utf-8") as file:
            content = yaml.safe_load(file)
    except OSError as error:
        raise CalibrationError("%s cannot be read: %s" % (path, error.strerror)) from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise CalibrationError("%s is no YAML: %s" % (path, " ".join(str(error).split()))) from error
    if not isinstance(content, dict):
        raise CalibrationError("%s is no calibration: it has no line 'robot: hero_N'" % path)
    unknown = set(content) - {"robot", "date", "results", *_RANGES}
    if unknown:
        raise CalibrationError(
            "%s: unknown key %s; known are robot, date, results, %s"
            % (path, sorted(map(str, unknown))[0], ", ".join(_RANGES))
        )
    name = str(content.get("robot", ""))
    if not name.startswith("hero_") or not name[5:].isdecimal():
        raise CalibrationError("%s: robot is %r, but must be hero_N" % (path, name))
    results = content.get("results")
    values = {key: _read_numbers(path, key, content[key]) for key in _RANGES if key in content}
    centres = values.get("motor_centres_us")
    return Calibration(
        int(name[5:]),
        str(content.get("date", "")),
        None if centres is None else [int(round(centre)) for centre in centres],
        values.get("velocity_gains"),
        values.get("infrared_counts_m2"),
        results if isinstance(results, dict) else None,
    )


def _read_numbers(path: str, key: str, value: Any) -> List[float]:
    count, low, high, meaning = _RANGES[key]
    allowed = "%d numbers from %g to %g (%s)" % (count, low, high, meaning)
    if not isinstance(value, list) or len(value) != count:
        raise CalibrationError("%s: %s is %r, but must be %s" % (path, key, value, allowed))
    for number in value:
        if isinstance(number, bool) or not isinstance(number, (int, float)):
            raise CalibrationError("%s: %s holds %r, but must be %s" % (path, key, number, allowed))
        if not (math.isfinite(number) and low <= number <= high):
            raise CalibrationError("%s: %s holds %r, but must be %s" % (path, key, number, allowed))
    return [float(number) for number in value]
