"""The URDF: it is what the dimensions make, it can be read, and its frames are those of the robot."""

import math
import shutil
import subprocess
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
import yaml

from hero_description import dimensions
from hero_description.rviz_config import GOAL_TOPIC, POINT_TOPIC, make_config
from hero_description.urdf import make_urdf
from hero_description.view import read_names

URDF = Path(__file__).resolve().parents[2] / "urdf" / "hero.urdf"


@pytest.fixture(scope="module")
def robot():
    return ElementTree.fromstring(make_urdf().partition("?>")[2])


def test_the_file_is_what_the_dimensions_make():
    assert URDF.read_text(encoding="utf-8") == make_urdf(), "rosrun hero_description make_urdf urdf/hero.urdf"


@pytest.mark.skipif(
    shutil.which("check_urdf") is None, reason="check_urdf (liburdfdom-tools) is not installed"
)
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
def test_frames_stand_where_the_robots_own_transforms_put_them(robot, child, xyz_m):
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


def test_all_masses_together_are_not_more_than_the_robot(robot):
    masses = [float(mass.get("value")) for mass in robot.iter("mass")]
    assert math.fsum(masses) <= dimensions.MASS_KG


def test_inertias_are_those_of_real_bodies(robot):
    for inertia in robot.iter("inertia"):
        xx, yy, zz = (float(inertia.get(name)) for name in ("ixx", "iyy", "izz"))
        assert min(xx, yy, zz) > 0
        assert xx + yy >= zz and yy + zz >= xx and zz + xx >= yy


def list_displays(displays):
    """Return (class, topic or prefix) of displays, also of those in groups."""
    for display in displays:
        yield (
            display["Class"],
            display.get("TF Prefix") or display.get("Topic") or display.get("Marker Topic"),
        )
        yield from list_displays(display.get("Displays", []))


def test_rviz_shows_model_way_proximity_and_true_pose_of_every_robot_arena_and_lights():
    config = yaml.safe_load(make_config(["hero_0", "hero_7"], "world"))
    manager = config["Visualization Manager"]
    assert manager["Global Options"]["Fixed Frame"] == "world"
    shown = set(list_displays(manager["Displays"]))
    for name in ("hero_0", "hero_7"):
        assert ("rviz/RobotModel", name) in shown
        assert ("rviz/Odometry", "/%s/odom" % name) in shown
        assert ("rviz/Odometry", "/%s/ground_truth" % name) in shown
        assert ("rviz/LaserScan", "/%s/proximity" % name) in shown
    assert ("rviz/MarkerArray", "/hero_sim/arena") in shown
    assert ("rviz/MarkerArray", "/hero_lights") in shown


def test_rviz_has_tools_that_choose_a_robot_and_give_it_a_goal():
    tools = yaml.safe_load(make_config(["hero_0"], "world"))["Visualization Manager"]["Tools"]
    topics = {tool["Class"]: tool.get("Topic") for tool in tools}
    assert topics["rviz/PublishPoint"] == POINT_TOPIC
    assert topics["rviz/SetGoal"] == GOAL_TOPIC


def test_rviz_looks_straight_down_on_request():
    config = yaml.safe_load(make_config(["hero_0"], "world", "above"))
    assert config["Visualization Manager"]["Views"]["Current"]["Class"] == "rviz/TopDownOrtho"


@pytest.mark.parametrize(
    ("text", "names"),
    [("2", ["hero_2"]), ("0,5", ["hero_0", "hero_5"]), ("0 2-4", ["hero_0", "hero_2", "hero_3", "hero_4"])],
)
def test_robots_are_listed_by_id(text, names):
    assert read_names(text) == names


@pytest.mark.parametrize("text", ["", "-1", "3-2", "all", "1,x", "0-100", "0-999999999"])
def test_other_robots_are_refused(text):
    with pytest.raises(ValueError, match="ids"):
        read_names(text)
