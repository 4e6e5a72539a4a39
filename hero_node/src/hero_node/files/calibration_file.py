"""Files of `calibrate`, hero_N.yaml: their schema, and a folder of them, of which a damaged one harms no other."""

import os
import re
from typing import Any, Dict, List, NamedTuple, Tuple

from ..errors import HeroError
from ..texts import make_printable, shorten
from .marked_yaml import Entry, EntryError, load_entries

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
    may_be_nan: bool = False  # a number that is not known


SETTINGS = {
    "motor_centers_us": Numbers(2, 1200.0, 1800.0, "left, right"),
    "velocity_gains": Numbers(6, 0.0, 1e5, "P I D of the left wheel, then of the right"),
    "infrared_counts_m2": Numbers(8, 1e-3, 100.0, "by index of proximity"),
}
"""Settings in a robot's flash."""

RESULTS = {
    "wheels_m": Numbers(3, 0.01, 1.0, "diameters of the left and the right wheel, distance between them"),
    "dead_zones_us": Numbers(4, 0.0, 3000.0, "edges of the left wheel, then of the right"),
    "velocity_errors": Numbers(2, 0.0, 100.0, "before, after", may_be_nan=True),
    "range_errors_before_m": Numbers(8, -10.0, 10.0, "by index of proximity", may_be_nan=True),
    "range_errors_after_m": Numbers(8, -10.0, 10.0, "by index of proximity", may_be_nan=True),
}
"""Results that programs use, or that the user may want to look up."""

NUMBERS = {**SETTINGS, **RESULTS}

OTHERS = ("model", "ticks_per_turn")
"""Model of the robot, and ticks per turn of a wheel that were entered by hand."""

MODELS = (STOCK, HERO_PLUS)
"""Values of model; an empty one is not known."""

REMEDY = "correct the file, or move it away"


class KeptCalibration(NamedTuple):
    """The file of one robot: N of hero_N, date as text, numbers by key of SETTINGS and RESULTS, values of OTHERS."""

    robot_id: int
    date: str
    values: Dict[str, List[float]]
    others: Dict[str, Any] = {}


class Calibrations(NamedTuple):
    """A folder: what can be used, and why the rest cannot, by names of robots such as hero_3.

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
    """Read a file. Raises: CalibrationFileError with file, line, key, value and what is allowed."""
    robot = ""
    try:
        content = load_entries(path, "robot: hero_3").mapping(None, ("robot",))
        match = re.fullmatch(r"hero_([0-9]{1,9})", str(content["robot"].value))
        robot_id = int(match.group(1)) if match else content["robot"].refuse("hero_N")
        robot = "hero_%d" % robot_id
        values, others = _read_values(content)
    except EntryError as error:
        raise CalibrationFileError(f"{error}; {REMEDY}", robot) from error
    date = str(content["date"].value) if "date" in content else ""
    return KeptCalibration(robot_id, make_printable(date), values, others)


def _read_values(content: Dict[str, Entry]) -> Tuple[Dict[str, List[float]], Dict[str, Any]]:
    """Return the numbers and the others of a file. Raises: EntryError."""
    values: Dict[str, List[float]] = {}
    others: Dict[str, Any] = {}
    for key, entry in content.items():
        if key in NUMBERS:
            text = "%d numbers from %g to %g (%s)" % NUMBERS[key][:4]
            values[key] = entry.numbers(*NUMBERS[key][:3], text, NUMBERS[key].may_be_nan)
        elif key == "model":
            others[key] = "" if entry.value == "" else entry.choice(MODELS)
        elif key == "ticks_per_turn":
            others[key] = None if entry.value is None else entry.number(1.0, 1e6, "")
        elif key not in ("robot", "date"):
            names = ", ".join(("robot", "date", *OTHERS, *NUMBERS))
            raise EntryError(f"{entry.place}: unknown key {shorten(key)}; known are {names}")
    return values, others
