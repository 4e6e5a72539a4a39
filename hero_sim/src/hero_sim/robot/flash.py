"""The parameters that a robot keeps without power, in memory and in one file per robot.

The only file of the simulated robot that touches the file system.
"""

import json
import os
from typing import Optional, Sequence

from hero_node.files import EntryError, load_entries, write_file

from ..errors import CommandError, OptionError
from ..robot_constants import MAX_PARAMETER

_LENGTHS = {"ir_calibration_counts_m2": 8, "motor_centers_us": 2, "velocity_pid": 6, "position_pid": 6}

_ERASED_PID = [-1.0] * 6
"""The firmware then uses the gains of the program."""


class Flash:
    """The parameters of one robot: calibration of the sensors, centers of the servos, PID gains.

    Attributes:
        ir_calibration_counts_m2: one per sensor; NaN for a robot that was never calibrated.
        motor_centers_us: servo pulse at which each wheel rests.
        velocity_pid, position_pid: lkp lki lkd rkp rki rkd; -1 for a robot that was never tuned.
    """

    def __init__(
        self, ir_calibration_counts_m2: Sequence[float], motor_centers_us: Sequence[float] = (1500.0, 1500.0)
    ) -> None:
        """Begin with this calibration and these centers, and keep changes in memory only."""
        self.ir_calibration_counts_m2 = [float(value) for value in ir_calibration_counts_m2]
        self.motor_centers_us = list(motor_centers_us)
        self.velocity_pid = list(_ERASED_PID)
        self.position_pid = list(_ERASED_PID)
        self._path: Optional[str] = None

    def keep_in(self, path: str) -> None:
        """Load the file at path, if it is there, and write it at each change from now on.

        Raises: OptionError if the file cannot be read or is not ours. OSError if its folder cannot be made.
        """
        self._path = path
        folder = os.path.dirname(path)
        os.makedirs(folder, exist_ok=True)
        if not os.access(folder, os.W_OK):
            raise OptionError(f"--flash-dir {folder} is not writable; choose another")
        if not os.path.exists(path):
            return
        try:
            content = load_entries(path, "motor_centers_us: [1500, 1500]").mapping(None, tuple(_LENGTHS))
            for key, length in _LENGTHS.items():
                what, may_be_nan = "a list of %d numbers" % length, key == "ir_calibration_counts_m2"
                numbers = content[key].numbers(length, -MAX_PARAMETER, MAX_PARAMETER, what, may_be_nan)
                setattr(self, key, numbers)
        except EntryError as error:
            raise OptionError(f"flash file {error}; delete it to start over") from error

    def save(self) -> None:
        """Write the file, whole or not at all.

        Raises: CommandError if the file system refuses.
        """
        if self._path is None:
            return
        content = {key: getattr(self, key) for key in _LENGTHS}
        try:
            write_file(self._path, json.dumps(content, indent=1).encode())
        except OSError as error:
            raise CommandError(f"flash file {self._path} cannot be written: {error.strerror}") from error
