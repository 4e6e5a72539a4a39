"""The parameters that a robot keeps without power, in memory and in one file per robot.

The only file of the simulated robot that touches the file system.
"""

import hashlib
import json
import os
from contextlib import suppress
from typing import Any, Dict, List, Optional, Sequence, Tuple

from ..errors import CommandError, OptionError

__all__ = ["NO_FLASH_DIR", "Flash", "check_folder", "find_flash_dir", "make_fingerprint"]

_LENGTHS = {"ir_calibration_counts_m2": 8, "motor_centers_us": 2, "velocity_pid": 6, "position_pid": 6}

_LARGEST = 3.4e38  # a float of 32 bits

NO_FLASH_DIR = "none"
"""The option's value that keeps nothing over a restart of the simulator."""

_ERASED_PID = [-1.0] * 6
"""The firmware then uses the gains of the program."""

_REMEDY = "delete it to begin anew, or start with --flash-dir none"


def _make_mapping(pairs: List[Tuple[str, Any]]) -> Dict[str, Any]:
    """Return pairs as a dict. Raises: ValueError if a key is there twice."""
    content = dict(pairs)
    if len(content) < len(pairs):
        raise ValueError("a key is there twice")
    return content


def _is_storable(key: str, value: Any) -> bool:
    """Return whether a value is a number that a robot may keep; only a sensor without a calibration has NaN."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    return abs(value) <= _LARGEST or (value != value and key == "ir_calibration_counts_m2")


class Flash:
    """The parameters of one robot: calibration of the sensors, centers of the servos, PID gains.

    Attributes:
        ir_calibration_counts_m2: one per sensor; NaN for a robot that was never calibrated.
        motor_centers_us: servo pulse at which each wheel rests.
        is_from_file: whether an earlier run set something.
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
        self.is_from_file = False
        self._path: Optional[str] = None

    def keep_in(self, path: str) -> None:
        """Load the file at path, if it is there, and write it at each change from now on.

        Raises: OptionError if the file cannot be read or is not ours.
        """
        self._path = path
        try:
            with open(path, encoding="utf-8") as file:
                content = json.load(file, object_pairs_hook=_make_mapping)
        except (FileNotFoundError, NotADirectoryError):  # the latter is reported when something has to be kept
            return
        except (OSError, RecursionError, ValueError) as error:
            reason = error.strerror if isinstance(error, OSError) else error
            raise OptionError("flash file %s cannot be read: %s; %s" % (path, reason, _REMEDY)) from error
        for key, length in _LENGTHS.items():
            values = content.get(key) if isinstance(content, dict) else None
            if not (
                isinstance(values, list) and len(values) == length and all(_is_storable(key, value) for value in values)
            ):
                raise OptionError(
                    "flash file %s: %s must be a list of %d finite numbers; %s" % (path, key, length, _REMEDY)
                )
            setattr(self, key, [float(value) for value in values])
        self.is_from_file = True

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
            os.makedirs(os.path.dirname(self._path) or ".", exist_ok=True)
            with open(written, "w", encoding="utf-8") as file:
                json.dump(content, file, indent=1)
            os.replace(written, self._path)
        except OSError as error:
            with suppress(OSError):
                os.remove(written)
            raise CommandError("flash file %s cannot be written: %s" % (self._path, error.strerror)) from error


def find_flash_dir() -> str:
    """Return the default folder of the robots' parameters: beside ROS's logs."""
    ros_home = os.environ.get("ROS_HOME") or os.path.join(os.path.expanduser("~"), ".ros")
    return os.path.join(ros_home, "hero_sim")


def check_folder(folder: str) -> None:
    """Make the folder of the option --flash-dir.

    Raises: OptionError if it cannot be used.
    """
    try:
        os.makedirs(folder, exist_ok=True)
    except OSError as error:
        raise OptionError("--flash-dir %s cannot be made: %s; choose another" % (folder, error.strerror)) from error
    if not os.access(folder, os.W_OK):
        raise OptionError("--flash-dir %s is not writable; choose another" % folder)


def make_fingerprint(lines: Sequence[str]) -> str:
    """Return a short hash of lines, the same on every machine."""
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()[:8]
