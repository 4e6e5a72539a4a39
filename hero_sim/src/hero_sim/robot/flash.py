"""The parameters that a robot keeps without power, in memory and in one file per robot.

The only file of the simulated robot that touches the file system.
"""

import json
import os
from contextlib import suppress
from typing import Any, Optional, Sequence

from ..errors import CommandError, OptionError
from ..robot_constants import MAX_PARAMETER

_LENGTHS = {"ir_calibration_counts_m2": 8, "motor_centers_us": 2, "velocity_pid": 6, "position_pid": 6}

_ERASED_PID = [-1.0] * 6
"""The firmware then uses the gains of the program."""

_REMEDY = "delete it to start over"


def _is_storable(value: Any, may_be_erased: bool) -> bool:
    """Return whether a value is a number that a robot computes with; only a sensor's constant may be erased (NaN)."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    return abs(value) < MAX_PARAMETER or (value != value and may_be_erased)


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

        Raises: OptionError if its folder cannot be made, or the file cannot be read or is not ours.
        """
        self._path = path
        folder = os.path.dirname(path)
        try:
            os.makedirs(folder, exist_ok=True)
        except OSError as error:
            raise OptionError("--flash-dir %s cannot be made: %s; choose another" % (folder, error.strerror)) from error
        if not os.access(folder, os.W_OK):
            raise OptionError("--flash-dir %s is not writable; choose another" % folder)
        try:
            with open(path, encoding="utf-8") as file:
                content = json.load(file)
        except FileNotFoundError:
            return
        except (OSError, RecursionError, ValueError) as error:
            reason = error.strerror if isinstance(error, OSError) else error
            raise OptionError("flash file %s cannot be read: %s; %s" % (path, reason, _REMEDY)) from error
        for key, length in _LENGTHS.items():
            values = content.get(key) if isinstance(content, dict) else None
            may_be_erased = key == "ir_calibration_counts_m2"
            if (
                not isinstance(values, list)
                or len(values) != length
                or not all(_is_storable(value, may_be_erased) for value in values)
            ):
                raise OptionError("flash file %s: %s must be a list of %d numbers; %s" % (path, key, length, _REMEDY))
            setattr(self, key, [float(value) for value in values])

    def save(self) -> None:
        """Write the file, whole or not at all.

        Raises: CommandError if the file system refuses.
        """
        if self._path is None:
            return
        content = {key: getattr(self, key) for key in _LENGTHS}
        # Two simulators with the same robot may write at the same time.
        written = "%s.%d" % (self._path, os.getpid())
        try:
            with open(written, "w", encoding="utf-8") as file:
                json.dump(content, file, indent=1)
            os.replace(written, self._path)
        except OSError as error:
            with suppress(OSError):
                os.remove(written)
            raise CommandError("flash file %s cannot be written: %s" % (self._path, error.strerror)) from error
