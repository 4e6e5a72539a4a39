"""Writes kept calibrations into their robots again."""

from typing import Dict, List, Optional, Sequence

from hero_client.command_line import say
from hero_client.program import Program

from . import store
from .discovery import find_robots
from .errors import CalibrationError
from .probe import SETTINGS, Probe
from .session import Session


def restore(program: Program, folder: str, files: Sequence[str], robot_ids: Optional[Sequence[int]]) -> int:
    """Write files (none: all of folder) into their robots; return the exit code.

    Raises: CalibrationError for a wrong file, before anything is written.
    """
    kept = load_files(files or store.list_files(folder), robot_ids)
    if not kept:
        raise CalibrationError("no calibration of these robots in %s" % (", ".join(files) or folder))
    calibrations = {calibration.robot_id: calibration for calibration in kept}
    session = Session(program, find_robots(program, list(calibrations)))
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
        failure = "FAILED: %s; " % probe.failure if probe.failure else ""
        say("%s: %srestored %s of %s" % (probe.name, failure, keys, date))
    return 1 if any(probe.failure for probe in session.probes) else 0


def load_files(paths: Sequence[str], robot_ids: Optional[Sequence[int]]) -> List[store.Calibration]:
    """Return the calibrations of robots (None: all). Raises: CalibrationError, also for two files of one robot."""
    kept = [store.load(path) for path in paths]
    kept = [calibration for calibration in kept if robot_ids is None or calibration.robot_id in robot_ids]
    found = [calibration.robot_id for calibration in kept]
    for robot_id in found:
        if found.count(robot_id) > 1:
            raise CalibrationError("more than one file is for hero_%d; name only one of them" % robot_id)
    return kept
