"""Starts RViz with a configuration for the given robots.

    rosrun hero_description rviz _robots:=0-3

RViz replaces this process, so signals reach it and its exit status is this program's.
"""

import os
import shutil
import sys
import tempfile

from hero_node import ProgramError
from hero_node.parameters import Parameter, choice, flag, parse_explicit_ids
from hero_node.ros import Program, read_parameters

from .rviz_config import FRAMES, make_config, read_ids


def main() -> None:
    """Write the configuration and become RViz. Raises: ProgramError without RViz or a display."""
    rviz = shutil.which("rviz")
    if rviz is None:
        raise ProgramError("rviz is not installed; on Debian: apt-get install rviz")
    if not os.environ.get("DISPLAY"):
        raise ProgramError("no display: DISPLAY is not set")
    with Program("rviz", anonymous=True):
        parameters = read_parameters(
            {
                "robots": Parameter("0", parse_explicit_ids),
                "fixed_frame": "",
                "view": choice("orbit", sorted(FRAMES)),
                "picture": flag(False),
                "hero_plus": Parameter((), read_ids),
                "simulated": Parameter((), read_ids),
            }
        )
    groups = ("robots", "hero_plus", "simulated")
    names, plus_names, simulated = (["hero_%d" % robot_id for robot_id in parameters[group]] for group in groups)
    with tempfile.NamedTemporaryFile("w", prefix="hero_", suffix=".rviz", delete=False) as file:
        settings = str(parameters["fixed_frame"]), parameters["view"], parameters["picture"]
        file.write(make_config(names, *settings, hero_plus=plus_names, simulated=simulated))
    os.execv(rviz, [rviz, "-d", file.name, *sys.argv[1:]])
