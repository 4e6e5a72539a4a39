"""Starts RViz with a configuration made for the robots that are there.

    rosrun hero_description view --robots 4 --fixed-frame world

RViz takes this program's place, so that a signal reaches it and its exit code is this program's.
"""

import argparse
import os
import re
import shutil
import sys
import tempfile
from typing import List

import rospy

from .rviz_config import VIEWS, make_config

LONGEST_SWARM = 100


def read_names(text: str) -> List[str]:
    """Return the robots' names of a number ("4": hero_0 to hero_3) or of ids ("0,2,5"). Raises: ValueError."""
    if re.fullmatch(r"\d+", text):
        ids = list(range(int(text)))
    elif re.fullmatch(r"\d+(,\d+)+,?|\d+,", text):
        ids = [int(part) for part in text.split(",") if part]
    else:
        raise ValueError("neither a number of robots nor ids as in 0,2,5")
    if not 0 < len(ids) <= LONGEST_SWARM:
        raise ValueError("must be 1 to %d robots" % LONGEST_SWARM)
    return ["hero_%d" % robot_id for robot_id in ids]


def main() -> None:
    """Run the program view."""
    parser = argparse.ArgumentParser(prog="view", description="RViz, set up for the robots that are there.")
    parser.add_argument("--robots", default="1", help="a number (4: hero_0 to hero_3) or ids (0,2,5)")
    parser.add_argument("--fixed-frame", default="world", help="frame in which all is shown (world)")
    parser.add_argument("--view", choices=sorted(VIEWS), default="orbit", help="from where to look (orbit)")
    arguments = rospy.myargv()
    options = parser.parse_args(arguments[1:])
    try:
        names = read_names(options.robots)
    except ValueError as error:
        parser.error("--robots %s: %s" % (options.robots, error))
    rviz = shutil.which("rviz")
    if rviz is None:
        sys.exit("view: rviz is not installed; on Debian: apt-get install rviz")
    if not os.environ.get("DISPLAY"):
        sys.exit("view: no display: DISPLAY is not set")
    with tempfile.NamedTemporaryFile("w", prefix="hero_", suffix=".rviz", delete=False) as file:
        file.write(make_config(names, options.fixed_frame, options.view))
    remappings = [argument for argument in sys.argv[1:] if argument not in arguments]
    os.execv(rviz, [rviz, "-d", file.name, *remappings])
