"""The simulator as a ROS node: the same command line, ended by ROS.

ROS begins here; the robots themselves talk to the driver over TCP and never over ROS.
"""

import sys

import rospy

from . import main as command_line


def main() -> None:
    """Run the simulator until ROS shuts down."""
    arguments = rospy.myargv(sys.argv)[1:]
    rospy.init_node("hero_sim", disable_signals=True)
    sys.exit(command_line.main(arguments))
