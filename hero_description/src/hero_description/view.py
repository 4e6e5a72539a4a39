"""Starts RViz with a configuration made for the robots that are there.

    rosrun hero_description view --robots 0-3 --fixed-frame world

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
ROBOTS_HELP = "ids of the robots, such as 0 1 2 or 0-3 (0)"


def read_names(text: str) -> List[str]:
    """Return the names of the robots with these ids ("0 1 2", "0,1,2" or "0-2"). Raises: ValueError."""
    ids: List[int] = []
    for word in text.replace(",", " ").split():
        if not re.fullmatch(r"\d+(-\d+)?", word):
            raise ValueError("must be ids such as 0 1 2 or 0-3")
        first, _, last = word.partition("-")
        ids.extend(range(int(first), min(int(last or first), int(first) + LONGEST_SWARM) + 1))
    if not 0 < len(ids) <= LONGEST_SWARM:
        raise ValueError("must be the ids of 1 to %d robots, such as 0 1 2 or 0-3" % LONGEST_SWARM)
    return ["hero_%d" % robot_id for robot_id in ids]


def main() -> None:
    """Run the program view."""
    parser = argparse.ArgumentParser(prog="view", description="RViz, set up for the robots that are there.")
    parser.add_argument("--robots", default="0", help=ROBOTS_HELP)
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
