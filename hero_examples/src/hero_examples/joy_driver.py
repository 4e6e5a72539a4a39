"""Runs joy/joy_node with the same parameters where it is installed, and else says how to get it, in one line."""

import os
import sys

import rospkg


def main() -> None:
    try:
        rospkg.RosPack().get_path("joy")
    except rospkg.ResourceNotFound:
        sys.exit(
            "no joystick driver: the ROS package joy is not installed. ROS Noetic: sudo apt install"
            " ros-noetic-joy; elsewhere build it from ros-drivers/joystick_drivers, or start another node that"
            " publishes sensor_msgs/Joy on /joy and give joy_driver:=false"
        )
    os.execvp("rosrun", ["rosrun", "joy", "joy_node", *sys.argv[1:]])
