"""Publishes a joystick on /joy: by joy_node of the package joy where that is installed, else by Linux's own device.

The kernel sends the state of each axis and button when the device is opened, then each change, as records of 8 bytes
(joystick-api.rst of its documentation).
"""

import contextlib
import errno
import os
import select
import struct
import sys
from typing import List

import rospkg
import rospy
from sensor_msgs.msg import Joy

from hero_client import Program, ProgramError, read_parameters
from hero_node.parameters import number, string

_RECORD = struct.Struct("=IhBB")  # time, ms; value; kind; number
_BUTTON, _AXIS, _INITIAL = 0x01, 0x02, 0x80
_FULL = 32767.0
_READ_LENGTH = 64 * _RECORD.size


class JoystickDevice:
    """An open joystick.

    Attributes:
        axes: -1..1 each, left and up positive, as joy_node publishes them.
        buttons: 1 where pressed.
    """

    def __init__(self, path: str, deadzone: float = 0.05) -> None:
        """Open a device such as /dev/input/js0; values up to deadzone count as 0.

        Raises: ProgramError if it cannot be opened.
        """
        self._path = path
        self._deadzone = deadzone
        self.axes: List[float] = []
        self.buttons: List[int] = []
        try:
            self._file = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
        except FileNotFoundError:
            raise ProgramError(
                f"no joystick {path}: plug it in; ls /dev/input/js* lists those that are there"
            ) from None
        except PermissionError:
            raise ProgramError(f"{path}: may not be read: sudo usermod -a -G input $USER, then log in again") from None
        except OSError as error:
            raise ProgramError(f"{path}: cannot be read: {error.strerror}") from None

    def read(self, timeout_s: float) -> None:
        """Wait at most timeout_s for a change, and take it over. Raises: ProgramError when the joystick has gone."""
        if not select.select([self._file], [], [], timeout_s)[0]:
            return
        try:
            data = os.read(self._file, _READ_LENGTH)
        except OSError as error:
            if error.errno != errno.ENODEV:
                raise ProgramError(f"{self._path}: cannot be read: {error.strerror}") from None
            data = b""
        if not data:
            raise ProgramError(f"the joystick {self._path} has gone: plug it in and start again")
        # The kernel gives whole records only.
        for _, value, kind, index in _RECORD.iter_unpack(data[: len(data) // _RECORD.size * _RECORD.size]):
            if kind & ~_INITIAL == _AXIS:
                # Without the dead zone: what lies beyond it starts at 0.
                beyond = max(0.0, min(1.0, abs(value) / _FULL) - self._deadzone) / (1.0 - self._deadzone)
                self._set(self.axes, index, -beyond if value > 0 else beyond)
            elif kind & ~_INITIAL == _BUTTON:
                self._set(self.buttons, index, value)

    @staticmethod
    def _set(values: List, index: int, value: float) -> None:
        values.extend([type(value)(0)] * (index + 1 - len(values)))
        values[index] = value

    def close(self) -> None:
        """Close the device; safe to call twice."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1


def main() -> None:
    with contextlib.suppress(rospkg.ResourceNotFound):
        rospkg.RosPack().get_path("joy")
        os.execvp("rosrun", ["rosrun", "joy", "joy_node", *sys.argv[1:]])
    with Program("joy_driver", anonymous=True) as program:
        parameters = read_parameters(
            {
                "dev": string("/dev/input/js0"),
                "deadzone": number(0.05, 0.0, 0.9),
                "autorepeat_rate": number(20.0, 1.0, 100.0, "Hz"),
            }
        )
        publisher = rospy.Publisher("joy", Joy, queue_size=1)
        with contextlib.closing(JoystickDevice(parameters["dev"], parameters["deadzone"])) as device:
            while program.running:
                device.read(1.0 / parameters["autorepeat_rate"])
                message = Joy(axes=device.axes, buttons=device.buttons)
                message.header.stamp = rospy.Time.now()
                publisher.publish(message)
