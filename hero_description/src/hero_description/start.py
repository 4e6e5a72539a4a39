"""Starts a ROS node, or ends the program in one line where that cannot work."""

import http.client
import sys

import rosgraph
import rospy


def start_node(name: str) -> None:
    """Start the node called name; without a ROS master, end the program with exit status 1."""
    # rospy would wait for a master for ever, and end in a traceback where the address is none.
    try:
        is_online = rosgraph.is_master_online()
    except (OSError, OverflowError, ValueError, http.client.HTTPException):
        is_online = False
    if not is_online:
        sys.exit(
            "%s: no ROS master at %r: start roslaunch hero_bringup hero_bringup.launch first, or set ROS_MASTER_URI,"
            " for example to http://localhost:11311" % (name, rosgraph.get_master_uri())
        )
    rospy.init_node(name)
