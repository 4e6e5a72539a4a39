"""Starts RViz with a configuration for the given robots.

    rosrun hero_description rviz _robots:=0-3

RViz replaces this process, so signals reach it and its exit status is this program's.
"""

import os
import shutil
import sys
import tempfile
import xml.etree.ElementTree as ElementTree

import rospy

from hero_node import ProgramError
from hero_node.parameters import Parameter, choice, flag, parse_explicit_ids
from hero_node.robot_constants import HERO, MODELS
from hero_node.ros import Program, read_parameters

from .rviz_config import FRAMES, PLUS_DESCRIPTION, make_config, read_ids

PLUS = MODELS["hero_plus"]

SHIELD_HEIGHT_M = 0.004
"""Height of HeRo+'s bump shield, chosen for the eye."""


def make_hero_plus(urdf: str) -> str:
    """Return the URDF of HeRo+, from that of the stock robot: larger wheels, and a bump shield around the body."""
    robot = ElementTree.fromstring(urdf)  # noqa: S314 - this package's own file
    robot.set("name", "hero_plus")
    for cylinder in robot.iter("cylinder"):
        if cylinder.get("radius") == f"{HERO.wheel_diameter_m / 2.0:g}":
            cylinder.set("radius", f"{PLUS.wheel_diameter_m / 2.0:g}")
    for joint in robot.iter("joint"):
        origin, side = joint.find("origin"), {"left_wheel_joint": 1, "right_wheel_joint": -1}.get(joint.get("name", ""))
        if origin is not None and side is not None:
            _, _, z_m = origin.get("xyz", "").split()
            origin.set("xyz", f"0 {side * PLUS.wheel_separation_m / 2.0:g} {z_m}")
    base = robot.find("link[@name='base_link']")
    if base is not None:
        for kind in ("collision", "visual"):
            shape = ElementTree.SubElement(base, kind)
            ElementTree.SubElement(shape, "origin", xyz="0 0 0.02", rpy="0 0 0")
            size = {"radius": f"{PLUS.body_radius_m:g}", "length": f"{SHIELD_HEIGHT_M:g}"}
            ElementTree.SubElement(ElementTree.SubElement(shape, "geometry"), "cylinder", size)
        ElementTree.SubElement(shape, "material", name="rim")
    return ElementTree.tostring(robot, encoding="unicode")


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
        if parameters["hero_plus"]:
            rospy.set_param(PLUS_DESCRIPTION, make_hero_plus(str(rospy.get_param("robot_description"))))
    groups = ("robots", "hero_plus", "simulated")
    names, plus_names, simulated = (["hero_%d" % robot_id for robot_id in parameters[group]] for group in groups)
    with tempfile.NamedTemporaryFile("w", prefix="hero_", suffix=".rviz", delete=False) as file:
        settings = str(parameters["fixed_frame"]), parameters["view"], parameters["picture"]
        file.write(make_config(names, *settings, hero_plus=plus_names, simulated=simulated))
    os.execv(rviz, [rviz, "-d", file.name, *sys.argv[1:]])
