"""Ends a launch file with one line: an argument of the stock packages that is not read here, and what to give instead.

<node pkg="hero_node" type="old_argument" name="..." args="ARGUMENT: REMEDY" required="true"/>
"""

import rospy

from ..errors import ProgramError


def main() -> None:
    """Raise what the arguments say."""
    raise ProgramError(" ".join(rospy.myargv()[1:]))
