"""Writes kept calibrations into their robots again."""

from typing import Dict, List, Optional, Sequence

from hero_node import say
from hero_node.files import SETTINGS, KeptCalibration, list_files, read_calibration

from ..errors import CalibrationError
from ..robots.probe import Probe
from ..robots.session import Session


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
