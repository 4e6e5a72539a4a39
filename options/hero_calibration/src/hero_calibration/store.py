"""Keeps the calibration of a robot in a YAML file, from which it can be restored. Pure but for the files."""

import os
from contextlib import suppress

from hero_node.files import (
    PREVIOUS,
    CalibrationFileError,
    KeptCalibration,
    lock_file,
    read_calibration,
    read_text,
    replace_values,
    write_file,
)

from .errors import CalibrationError


def name_file(folder: str, robot_id: int) -> str:
    """Return the path of a robot's file."""
    return os.path.join(folder, "hero_%d.yaml" % robot_id)


def make_folder(folder: str) -> None:
    """Create a folder unless it exists. Raises: CalibrationError."""
    try:
        os.makedirs(folder, exist_ok=True)
    except OSError as error:
        raise CalibrationError(f"{folder} cannot be created: {error.strerror}") from error


def save(path: str, calibration: KeptCalibration) -> None:
    """Write a file; the previous one is kept beside it. Its comments and values that were not measured again stay.

    A damaged previous file, or one of another robot or model, does not prevent the new one. Raises: CalibrationError.
    """
    base, suffix = os.path.splitext(path)
    values, others, text = calibration.values, calibration.others, ""
    try:
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
    except OSError as error:
        raise CalibrationError(f"{path} cannot be written: {error.strerror}") from error
