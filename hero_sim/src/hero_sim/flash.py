"""The parameters that a robot keeps without power, in memory and, where a folder is given, in one file per
robot.

Borders: the only file of the simulated robot that touches the file system besides arena_file.
"""

import json
import os
from typing import List, Optional, Sequence

import numpy as np

from .errors import CommandError, OptionError

_LENGTHS = {"ir_calibration_counts_m2": 8, "motor_centres_us": 2, "velocity_pid": 6, "position_pid": 6}

_ERASED_PID = [-1.0] * 6
"""What the firmware takes for "use the gains of the program"."""


class Flash:
    """What one robot keeps: calibration of the sensors, middle of the servos, PID parameters.

    Attributes:
        ir_calibration_counts_m2: one per sensor; NaN for a robot that was never calibrated.
        motor_centres_us: servo pulse at which each wheel stands.
        velocity_pid, position_pid: lkp lki lkd rkp rki rkd; -1 for a robot that was never tuned.
    """

    def __init__(
        self,
        ir_calibration_counts_m2: List[float],
        motor_centres_us: Sequence[float] = (1500.0, 1500.0),
        path: Optional[str] = None,
    ) -> None:
        """Begin with a calibration, then take over what the file at path holds; None keeps nothing.

        Raises: OptionError if the folder cannot be used, or the file cannot be read or is not ours.
        """
        self.ir_calibration_counts_m2 = [float(value) for value in np.asarray(ir_calibration_counts_m2)]
        self.motor_centres_us = list(motor_centres_us)
        self.velocity_pid = list(_ERASED_PID)
        self.position_pid = list(_ERASED_PID)
        self._path = path
        if path is not None:
            self._check_folder(path)
            if os.path.exists(path):
                self._load(path)

    @staticmethod
    def _check_folder(path: str) -> None:
        folder = os.path.dirname(path) or "."
        try:
            os.makedirs(folder, exist_ok=True)
        except OSError as error:
            raise OptionError(
                "--flash-dir %s cannot be made: %s; choose another" % (folder, error.strerror)
            ) from error
        if not os.access(folder, os.W_OK):
            raise OptionError("--flash-dir %s is not writable; choose another" % folder)

    def _load(self, path: str) -> None:
        try:
            with open(path, encoding="utf-8") as file:
                content = json.load(file)
        except (OSError, ValueError) as error:
            raise OptionError(
                "flash file %s cannot be read: %s; delete it to begin anew" % (path, error)
            ) from error
        for key, length in _LENGTHS.items():
            values = content.get(key) if isinstance(content, dict) else None
            if not isinstance(values, list) or len(values) != length:
                raise OptionError(
                    "flash file %s: %s must be a list of %d numbers; delete the file to begin anew"
                    % (path, key, length)
                )
            try:
                setattr(self, key, [float(value) for value in values])
            except (TypeError, ValueError) as error:
                raise OptionError("flash file %s: %s: %s" % (path, key, error)) from error

    def save(self) -> None:
        """Write the file, whole or not at all.

        Raises: CommandError if the file system refuses.
        """
        if self._path is None:
            return
        content = {key: getattr(self, key) for key in _LENGTHS}
        try:
            with open(self._path + ".new", "w", encoding="utf-8") as file:
                json.dump(content, file, indent=1)
            os.replace(self._path + ".new", self._path)
        except OSError as error:
            raise CommandError(
                "flash file %s cannot be written: %s" % (self._path, error.strerror)
            ) from error
