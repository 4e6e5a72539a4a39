"""The URDF is valid, and its frames, masses and inertias are those of the robot."""

import math
import shutil
import subprocess
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

URDF = Path(__file__).resolve().parents[2] / "urdf" / "hero.urdf"
MASS_KG = 0.156  # one robot on the scales, with battery


@pytest.fixture(scope="module")
def robot():
    return ElementTree.parse(str(URDF)).getroot()


@pytest.mark.skipif(shutil.which("check_urdf") is None, reason="check_urdf (liburdfdom-tools) is not installed")
def test_check_urdf_reads_it():
    subprocess.run(["check_urdf", str(URDF)], check=True, stdout=subprocess.DEVNULL)


def test_frames_are_those_that_the_robot_publishes(robot):
    names = {link.get("name") for link in robot.findall("link")}
    assert names == {"base_link", "left_wheel_link", "right_wheel_link", "hat_link", "laser_link"}
    assert {joint.find("parent").get("link") for joint in robot.findall("joint")} == {"base_link"}


@pytest.mark.parametrize(
    ("child", "xyz_m"),
    [
        ("left_wheel_link", (0.0, 0.0315, 0.01548)),
        ("right_wheel_link", (0.0, -0.0315, 0.01548)),
        ("hat_link", (-0.00245, -0.00216, 0.051)),
        ("laser_link", (0.0, 0.0, 0.051)),
    ],
)
def test_frames_are_where_the_robots_own_transforms_are(robot, child, xyz_m):
    (joint,) = [joint for joint in robot.findall("joint") if joint.find("child").get("link") == child]
    assert [float(text) for text in joint.find("origin").get("xyz").split()] == pytest.approx(xyz_m)


@pytest.mark.parametrize(
    ("link", "mass_kg", "moments_kg_m2"),
    [
        ("base_link", 0.090, (5.925e-05, 5.5125e-05, 5.925e-05)),
        ("hat_link", 0.010, (3.39583e-06, 3.39583e-06, 6.125e-06)),
        ("left_wheel_link", 0.020, (1.61583e-06, 3.125e-06, 1.61583e-06)),
        ("right_wheel_link", 0.020, (1.61583e-06, 3.125e-06, 1.61583e-06)),
    ],
)
def test_masses_and_inertias_are_the_published_ones(robot, link, mass_kg, moments_kg_m2):
    (inertial,) = [one.find("inertial") for one in robot.findall("link") if one.get("name") == link]
    assert float(inertial.find("mass").get("value")) == pytest.approx(mass_kg)
    moments = [float(inertial.find("inertia").get(name)) for name in ("ixx", "iyy", "izz")]
    assert moments == pytest.approx(moments_kg_m2, rel=1e-5)


def test_masses_add_up_to_at_most_that_of_the_robot(robot):
    masses = [float(mass.get("value")) for mass in robot.iter("mass")]
    assert math.fsum(masses) <= MASS_KG


def test_inertias_are_possible(robot):
    for inertia in robot.iter("inertia"):
        xx, yy, zz = (float(inertia.get(name)) for name in ("ixx", "iyy", "izz"))
        assert min(xx, yy, zz) > 0
        assert xx + yy >= zz and yy + zz >= xx and zz + xx >= yy
