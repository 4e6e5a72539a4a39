"""Publishes a joystick on /joy: by joy_node of the package joy where that is installed, else by Linux's own device.

The kernel sends the state of each axis and button when the device is opened, then each change, as records of 8 bytes
(joystick-api.rst of its documentation).
"""

import contextlib
import errno
import os
import struct
import sys

import rospkg
import rospy
from sensor_msgs.msg import Joy

from hero_client import Program, ProgramError, read_parameters
from hero_node.parameters import number, string

_RECORD = struct.Struct("=IhBB")  # time, ms; value; kind; number
_BUTTON, _AXIS, _INITIAL = 0x01, 0x02, 0x80
_FULL = 32767.0


def note_changes(joy, data, deadzone):
    """Put what records say into a sensor_msgs/Joy: axes -1..1, left and up positive as of joy_node, and buttons.

    deadzone: values of axes up to this count as 0; what lies beyond begins there.
    """
    for _, value, kind, index in _RECORD.iter_unpack(data):
        values = {_AXIS: joy.axes, _BUTTON: joy.buttons}.get(kind & ~_INITIAL)
        if values is None:
            continue
        if values is joy.axes:
            beyond = max(0.0, min(1.0, abs(value) / _FULL) - deadzone) / (1.0 - deadzone)
            value = -beyond if value > 0 else beyond
        values.extend([type(value)(0)] * (index + 1 - len(values)))
        values[index] = value


def publish(program, path, deadzone, rate_hz):
    """Publish a device at each change, and at this rate, until the end. Raises: ProgramError if it cannot be read."""
    publisher, joy = rospy.Publisher("joy", Joy, queue_size=1), Joy(axes=[], buttons=[])
    try:
        with open(path, "rb", buffering=0, opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)) as device:
            while program.running:
                if program.wait_readable([device.fileno()], 1.0 / rate_hz):
                    data = device.read(64 * _RECORD.size)
                    if not data:
                        raise OSError(errno.ENODEV, os.strerror(errno.ENODEV))
                    note_changes(joy, data, deadzone)
                joy.header.stamp = rospy.Time.now()
                publisher.publish(joy)
    except OSError as error:
        remedy = "plug it in (ls /dev/input/js*), or join the group input (sudo usermod -a -G input $USER)"
        raise ProgramError(f"no joystick {path} ({error.strerror}): {remedy}") from None


def main():
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
        publish(program, *parameters.values())
