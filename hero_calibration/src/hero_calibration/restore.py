"""Writes kept calibrations into their robots again."""

from concurrent.futures import ThreadPoolExecutor
from typing import List, Optional, Sequence

from hero_client.command_line import say
from hero_client.program import Program

from . import store
from .discovery import find_robots
from .errors import CalibrationError
from .probe import SETTINGS, Probe


def restore(program: Program, folder: str, files: Sequence[str], robot_ids: Optional[Sequence[int]]) -> int:
    """Write files (none: all of folder) into their robots; return the exit code.

    Raises: CalibrationError for a wrong file, before anything is written.
    """
    kept = load_files(files or store.list_files(folder), robot_ids)
    if not kept:
        raise CalibrationError("no calibration of these robots in %s" % (", ".join(files) or folder))
    robots = find_robots(program, [calibration.robot_id for calibration in kept])

    def write(calibration: store.Calibration) -> Optional[str]:
        """Write a calibration; return why it failed, None if it did not."""
        failure = robots[calibration.robot_id]
        if failure is not None:
            return failure
        probe = Probe(calibration.robot_id)
        written: List[str] = []
        try:
            for key in settings_of(calibration):
                probe.write(key, calibration.values[key])
                written.append(key)
        except CalibrationError as error:
            return "%s (written: %s)" % (error, ", ".join(written) or "nothing")
        return None

    with ThreadPoolExecutor(min(32, len(kept))) as pool:
        failures = list(pool.map(write, kept))
    for calibration, failure in zip(kept, failures):
        written = ", ".join(settings_of(calibration)) or "nothing"
        text = "restored %s of %s" % (written, calibration.date or "an unknown day")
        say("hero_%d: %s" % (calibration.robot_id, "FAILED: " + failure if failure else text))
    return 1 if any(failures) else 0


def settings_of(calibration: store.Calibration) -> List[str]:
    """Return the keys of what can be written to the robot."""
    return [key for key in SETTINGS if key in calibration.values]


def load_files(paths: Sequence[str], robot_ids: Optional[Sequence[int]]) -> List[store.Calibration]:
    """Return the calibrations of robots (None: all). Raises: CalibrationError, also for two files of one robot."""
    kept = [store.load(path) for path in paths]
    kept = [calibration for calibration in kept if robot_ids is None or calibration.robot_id in robot_ids]
    found = [calibration.robot_id for calibration in kept]
    for robot_id in found:
        if found.count(robot_id) > 1:
            raise CalibrationError("more than one file is for hero_%d; name only one of them" % robot_id)
    return kept
