"""Starts RViz with a configuration for the given robots.

    rosrun hero_description rviz _robots:=0-3

RViz replaces this process, so signals reach it and its exit status is this program's.
"""

import os
import shutil
import sys
import tempfile

from hero_node.errors import ProgramError
from hero_node.parameters import choice, flag
from hero_node.ros.private_parameters import read_parameters
from hero_node.ros.program import Program, run

from .robots_parameter import given_robots
from .rviz_config import FRAMES, make_config


def start_rviz() -> None:
    """Write the configuration and become RViz. Raises: ProgramError without RViz or a display."""
    rviz = shutil.which("rviz")
    if rviz is None:
        raise ProgramError("rviz is not installed; on Debian: apt-get install rviz")
    if not os.environ.get("DISPLAY"):
        raise ProgramError("no display: DISPLAY is not set")
    with Program("rviz", anonymous=True):
        parameters = read_parameters(
            {
                "robots": given_robots(),
                "fixed_frame": "",
                "view": choice("orbit", sorted(FRAMES)),
                "picture": flag(False),
            }
        )
    names = ["hero_%d" % robot_id for robot_id in parameters["robots"]]
    with tempfile.NamedTemporaryFile("w", prefix="hero_", suffix=".rviz", delete=False) as file:
        file.write(make_config(names, str(parameters["fixed_frame"]), parameters["view"], parameters["picture"]))
    os.execv(rviz, [rviz, "-d", file.name, *sys.argv[1:]])


def main() -> None:
    """Run the program rviz."""
    run(start_rviz)
