"""Publishes a joystick on /joy: by joy_node of the package joy where that is installed, else by Linux's own device."""

import contextlib
import os
import sys

import rospkg
import rospy
from sensor_msgs.msg import Joy

from hero_client import Program, read_parameters
from hero_node.parameters import number, string

from .joystick_device import JoystickDevice


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
