"""The parameters that a robot keeps without power, in memory and in one file per robot.

Borders: the only file of the simulated robot that touches the file system besides arena_file.
"""

import hashlib
import json
import os
from typing import Optional, Sequence

from .errors import CommandError, OptionError

_LENGTHS = {"ir_calibration_counts_m2": 8, "motor_centres_us": 2, "velocity_pid": 6, "position_pid": 6}

NO_FLASH_DIR = "none"
"""What people say instead of a folder if nothing shall be kept over a restart of the simulator."""

_ERASED_PID = [-1.0] * 6
"""What the firmware takes for "use the gains of the program"."""


class Flash:
    """What one robot keeps: calibration of the sensors, middle of the servos, PID parameters.

    Attributes:
        ir_calibration_counts_m2: one per sensor; NaN for a robot that was never calibrated.
        motor_centres_us: servo pulse at which each wheel stands.
        is_from_file: whether an earlier run set something.
        velocity_pid, position_pid: lkp lki lkd rkp rki rkd; -1 for a robot that was never tuned.
    """

    def __init__(
        self, ir_calibration_counts_m2: Sequence[float], motor_centres_us: Sequence[float] = (1500.0, 1500.0)
    ) -> None:
        """Begin with this calibration and these centres, and keep what is set in memory only."""
        self.ir_calibration_counts_m2 = [float(value) for value in ir_calibration_counts_m2]
        self.motor_centres_us = list(motor_centres_us)
        self.velocity_pid = list(_ERASED_PID)
        self.position_pid = list(_ERASED_PID)
        self.is_from_file = False
        self._path: Optional[str] = None

    def keep_in(self, path: str) -> None:
        """Take over what the file at path holds, if it is there, and write it at each change from now on.

        Raises: OptionError if the file cannot be read or is not ours.
        """
        self._path = path
        if os.path.exists(path):
            self._load(path)
            self.is_from_file = True

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
        # Two simulators with the same robot may write at the same time.
        written = "%s.%d" % (self._path, os.getpid())
        try:
            os.makedirs(os.path.dirname(self._path) or ".", exist_ok=True)
            with open(written, "w", encoding="utf-8") as file:
                json.dump(content, file, indent=1)
            os.replace(written, self._path)
        except OSError as error:
            raise CommandError(
                "flash file %s cannot be written: %s" % (self._path, error.strerror)
            ) from error


def find_flash_dir() -> str:
    """Return the folder in which robots keep their parameters unless people name another: beside ROS's logs."""
    ros_home = os.environ.get("ROS_HOME") or os.path.join(os.path.expanduser("~"), ".ros")
    return os.path.join(ros_home, "hero_sim")


def check_folder(folder: str) -> None:
    """Make the folder that people named.

    Raises: OptionError if it cannot be used.
    """
    try:
        os.makedirs(folder, exist_ok=True)
    except OSError as error:
        raise OptionError(
            "--flash-dir %s cannot be made: %s; choose another" % (folder, error.strerror)
        ) from error
    if not os.access(folder, os.W_OK):
        raise OptionError("--flash-dir %s is not writable; choose another" % folder)


def make_fingerprint(lines: Sequence[str]) -> str:
    """Return a short name for what lines say, the same on every machine."""
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()[:8]
