"""Calibrations of robots in YAML files: kept, rated, listed, and written into the robots again. Knows no ROS."""

import math
import os
from contextlib import suppress
from statistics import median
from typing import Dict, List, Optional, Sequence, Tuple

from hero_node import say
from hero_node.files import (
    PREVIOUS,
    SETTINGS,
    CalibrationFileError,
    Calibrations,
    KeptCalibration,
    list_files,
    lock_file,
    read_calibration,
    read_text,
    replace_values,
    write_file,
)

from .errors import CalibrationError
from .robots.probe import Probe
from .robots.session import Session

KEYS = {
    "motors": "motor_centers_us",
    "velocity": "velocity_gains",
    "infrared": "infrared_counts_m2",
    "wheels": "wheels_m",
}
"""Parts of a calibration, each with the key that a file holds after it."""

WORSE = 2.0
"""A result that exceeds the median of all robots by this factor is worse than the rest."""


def name_file(folder: str, robot_id: int) -> str:
    """Return the path of a robot's file."""
    return os.path.join(folder, "hero_%d.yaml" % robot_id)


def save(path: str, calibration: KeptCalibration) -> None:
    """Write a file; the previous one is kept beside it. Values that were not measured again stay, with their comments.

    A damaged previous file, or one of another robot or model, does not prevent the new one. Raises: OSError.
    """
    base, suffix = os.path.splitext(path)
    values, others, text = calibration.values, calibration.others, ""
    with lock_file(path):
        if os.path.exists(path):
            with open(path, "rb") as file:
                write_file(base + PREVIOUS + suffix, file.read())
            with suppress(CalibrationFileError):
                old = read_calibration(path)
                is_same_model = old.others.get("model", others.get("model")) == others.get("model")
                if old.robot_id == calibration.robot_id and is_same_model:
                    values, others, text = {**old.values, **values}, {**old.others, **others}, read_text(path)
        content = {"robot": "hero_%d" % calibration.robot_id, "date": calibration.date, **others, **values}
        write_file(path, replace_values(text, content).encode())


def rate(kept: KeptCalibration) -> Tuple[Optional[float], Optional[float]]:
    """Return the errors that are left: of velocity, as a share, and the largest of ranges, m; None: not known."""
    velocity = kept.values.get("velocity_errors", [math.nan, math.nan])[1]
    ranges = [abs(error_m) for error_m in kept.values.get("range_errors_after_m", []) if not math.isnan(error_m)]
    return None if math.isnan(velocity) else velocity, max(ranges, default=None)


def find_missing(found: Dict[str, KeptCalibration], robot_ids: Sequence[int], parts: Sequence[str]) -> List[int]:
    """Return the robots that lack a part."""
    kept = {number: found.get("hero_%d" % number) for number in robot_ids}
    return [
        number for number, one in kept.items() if one is None or any(KEYS[part] not in one.values for part in parts)
    ]


def describe_status(calibrations: Calibrations) -> List[str]:
    """Return a table of all robots with a file, and a line for each file that cannot be used."""
    found = sorted(calibrations.found.values(), key=lambda kept: kept.robot_id)
    qualities = [rate(kept) for kept in found]
    limits = [_find_limit([quality[index] for quality in qualities]) for index in (0, 1)]
    lines = ["%-10s %-20s %-34s %-9s %s" % ("ROBOT", "DATE", "PARTS", "VELOCITY", "RANGE")]
    for kept, quality in zip(found, qualities):
        parts = ", ".join(part for part, key in KEYS.items() if key in kept.values) or "none"
        velocity = "-" if quality[0] is None else f"{100 * quality[0]:.1f} %"
        range_text = "-" if quality[1] is None else f"{1000 * quality[1]:.0f} mm"
        is_worse = any(value is not None and value > limit for value, limit in zip(quality, limits))
        line = "%-10s %-20s %-34s %-9s %-6s" % ("hero_%d" % kept.robot_id, kept.date, parts, velocity, range_text)
        lines.append((line + (" worse than the rest" if is_worse else "")).rstrip())
    return lines + [f"{name}: {problem}" for name, problem in sorted(calibrations.problems.items())]


def _find_limit(values: Sequence[Optional[float]]) -> float:
    known = [value for value in values if value is not None]
    return WORSE * median(known) if len(known) > 2 else math.inf


def load_calibrations(
    folder: str, files: Sequence[str], robot_ids: Optional[Sequence[int]]
) -> Dict[int, KeptCalibration]:
    """Return the calibrations of robots (None: all) in files (none: all of folder), by id.

    Raises: CalibrationFileError for a wrong file. CalibrationError for two files of one robot, or none at all.
    """
    calibrations: Dict[int, KeptCalibration] = {}
    for path in files or list_files(folder):
        calibration = read_calibration(path)
        if robot_ids is not None and calibration.robot_id not in robot_ids:
            continue
        if calibration.robot_id in calibrations:
            raise CalibrationError("more than one file is for hero_%d; name only one of them" % calibration.robot_id)
        calibrations[calibration.robot_id] = calibration
    if not calibrations:
        raise CalibrationError("no calibration of these robots in %s" % (", ".join(files) or folder))
    return calibrations


def restore(session: Session, calibrations: Dict[int, KeptCalibration]) -> int:
    """Write calibrations into the robots of session; return the exit code."""
    written: Dict[int, List[str]] = {probe.robot_id: [] for probe in session.probes}

    def write(probe: Probe) -> None:
        values = calibrations[probe.robot_id].values
        for key in SETTINGS:
            if key in values:
                probe.write(key, values[key])
                written[probe.robot_id].append(key)

    session.for_each("restore", write)
    for probe in session.probes:
        keys = ", ".join(written[probe.robot_id]) or "nothing"
        date = calibrations[probe.robot_id].date or "an unknown day"
        failure = f"FAILED: {probe.failure}; " if probe.failure else ""
        say(f"{probe.name}: {failure}restored {keys} of {date}")
    return 1 if any(probe.failure for probe in session.probes) else 0
