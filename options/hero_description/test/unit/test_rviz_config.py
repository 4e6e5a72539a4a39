"""What the configuration of RViz displays, and which robots it takes."""

import math
import os
import re
from colorsys import hls_to_rgb
from pathlib import Path
from unittest.mock import create_autospec

import pytest
import yaml

from hero_description.rviz_config import color_of, make_config

TOPIC_KEYS = ("TF Prefix", "Topic", "Marker Topic", "Image Topic")


def list_displays(displays):
    """Return (class, topic or prefix) of displays, also of those in groups."""
    for display in displays:
        yield (
            display["Class"],
            next((display[key] for key in TOPIC_KEYS if key in display), None),
        )
        yield from list_displays(display.get("Displays", []))


def test_rviz_displays_robots_arena_and_lights():
    config = yaml.safe_load(make_config(["hero_0", "hero_7"], "world"))
    manager = config["Visualization Manager"]
    assert manager["Global Options"]["Fixed Frame"] == "world"
    shown = set(list_displays(manager["Displays"]))
    for name in ("hero_0", "hero_7"):
        assert ("rviz/RobotModel", name) in shown
        assert ("rviz/Odometry", "/%s/odom" % name) in shown
        assert ("rviz/LaserScan", "/%s/proximity" % name) in shown
    for topic in ("/hero_sim/arena", "/hero_sim/object_markers", "/hero_sim/replay"):
        assert ("rviz/MarkerArray", topic) in shown
    assert ("rviz/MarkerArray", "/hero_lights") in shown
    assert ("rviz/MarkerArray", "/behavior/markers") in shown


def test_rviz_keeps_all_walls_until_their_transform_is_known():
    """Its queue holds single markers: of a longer array it drops the first ones for good."""
    displays = yaml.safe_load(make_config(["hero_0"], "map"))["Visualization Manager"]["Displays"]
    queues = {display["Marker Topic"]: display["Queue Size"] for display in displays if "Marker Topic" in display}
    assert queues["/hero_sim/arena"] >= 10000 and min(queues.values()) >= 10000


def list_switches(displays):
    """Return which displays, also of those in groups, are enabled, by name."""
    switches = {}
    for display in displays:
        assert display["Name"] not in switches
        switches[display["Name"]] = display["Enabled"]
        switches.update(list_switches(display.get("Displays", [])))
    return switches


@pytest.mark.parametrize("view", ["orbit", "above", "map"])
def test_displays_are_enabled_and_named_after_what_they_show(view):
    config = yaml.safe_load(make_config(["hero_3"], view=view, hero_plus=["hero_3"], simulated=["hero_3"]))
    switches = list_switches(config["Visualization Manager"]["Displays"])
    robots_own = {"hero_3", *("hero_3 " + what for what in ("distance", "path", "proximity", "pose", "odometry"))}
    assert robots_own == {name for name in switches if "hero" in name}
    simulated = {"arena (simulated)", "objects (simulated)", "robots of a replay", "odometry (simulated)"}
    assert {"Grid", *simulated} < set(switches)
    switched_off = {name for name, is_on in switches.items() if not is_on}
    assert switched_off == ({"localization"} if view != "map" else set()) | {"odometry (simulated)"}


def test_simulated_robots_are_drawn_where_they_are_and_odometry_as_a_ghost():
    config = yaml.safe_load(make_config(["hero_0", "hero_7"], simulated=["hero_7"]))
    displays = config["Visualization Manager"]["Displays"]
    models = {display["Name"]: display["TF Prefix"] for display in displays if "TF Prefix" in display}
    assert models == {"hero_0": "hero_0", "hero_7": "hero_7/true"}
    scans = {display["Topic"] for display in displays if display["Class"] == "rviz/LaserScan"}
    assert scans == {"/hero_0/proximity", "/hero_7/true/proximity"}
    (ghost,) = next(display for display in displays if display["Name"] == "odometry (simulated)")["Displays"]
    assert (ghost["TF Prefix"], ghost["Name"]) == ("hero_7", "hero_7 odometry")
    assert 0.0 < ghost["Alpha"] < 1.0 == displays[-2].get("Alpha", 1.0)


def test_robots_have_the_hues_of_the_monitor():
    script = Path(__file__).resolve().parents[3] / "hero_monitor" / "src" / "hero_monitor" / "web" / "map" / "colors.js"
    text = script.read_text(encoding="utf-8")
    step, start = map(float, re.search(r"id \* ([\d.]+) \+ ([\d.]+)", text).groups())
    saturation, lightness = (float(number) / 100 for number in re.search(r"(\d+)% \$.*: (\d+)}%", text).groups())
    for robot_id in (0, 1, 7, 250):
        hue = (step * robot_id + start) % 360.0
        assert color_of(robot_id) == pytest.approx(hls_to_rgb(hue / 360.0, lightness, saturation))


def test_robots_have_their_names_and_rings_in_the_color_of_their_paths():
    lights = pytest.importorskip("hero_description.lights", reason="imports rospy")
    name, ring = lights.make_identity(7)
    assert name.text == "hero_7" and name.header.frame_id == ring.header.frame_id == "hero_7/base_link"
    assert len(ring.points) == lights.RING_POINTS
    displays = yaml.safe_load(make_config(["hero_7"]))["Visualization Manager"]["Displays"]
    (path,) = [display["Shape"]["Color"] for display in displays if display["Name"] == "hero_7 path"]
    assert path == "; ".join("%d" % (255 * part) for part in (ring.color.r, ring.color.g, ring.color.b))
    assert len({color_of(robot_id) for robot_id in range(100)}) == 100


def test_the_view_of_the_map_shows_poses_and_grid_and_on_request_a_picture():
    manager = yaml.safe_load(make_config(["hero_0", "hero_7"], view="map"))["Visualization Manager"]
    assert manager["Global Options"]["Fixed Frame"] == "map"
    assert manager["Views"]["Current"]["Class"] == "rviz/TopDownOrtho"
    localization = manager["Displays"][-1]
    assert localization["Enabled"]
    assert set(list_displays(localization["Displays"])) == {
        ("rviz/Map", "/map"),
        ("rviz/PoseWithCovariance", "/hero_0/pose"),
        ("rviz/PoseWithCovariance", "/hero_7/pose"),
    }
    others = yaml.safe_load(make_config(["hero_0"], picture=True))["Visualization Manager"]["Displays"]
    assert not others[-2]["Enabled"]
    assert list(list_displays(others[-1:])) == [("rviz/Image", "/track/picture")]


def test_rviz_displays_the_distance_of_a_hero_plus():
    config = yaml.safe_load(make_config(["hero_0", "hero_7"], hero_plus=["hero_7"]))
    displays = config["Visualization Manager"]["Displays"]
    assert [one["Topic"] for one in displays if one["Class"] == "rviz/Range"] == ["/hero_7/range"]


def test_rviz_sends_goals_to_the_first_robot_until_told_another_topic():
    config = yaml.safe_load(make_config(["hero_4", "hero_0"], "world"))
    tools = config["Visualization Manager"]["Tools"]
    assert [tool["Topic"] for tool in tools if tool["Class"] == "rviz/SetGoal"] == ["/hero_4/goal"]
    assert "rviz/Tool Properties" in {panel["Class"] for panel in config["Panels"]}


def test_the_view_above_looks_straight_down():
    config = yaml.safe_load(make_config(["hero_0"], "world", "above"))
    view = config["Visualization Manager"]["Views"]["Current"]
    assert view["Class"] == "rviz/TopDownOrtho"
    assert (view["X"], view["Y"], view["Angle"]) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("view", ["orbit", "close"])
def test_other_views_look_down_on_the_middle_of_the_world(view):
    manager = yaml.safe_load(make_config(["hero_0"], view=view))["Visualization Manager"]
    camera = manager["Views"]["Current"]
    assert manager["Global Options"]["Fixed Frame"] == "world"
    assert camera["Class"] == "rviz/Orbit"
    assert (camera["Focal Point"]["X"], camera["Focal Point"]["Y"]) == (0.0, 0.0)
    assert 0.3 < camera["Pitch"] < 1.2
    # RViz shows 45 degrees from top to bottom.
    shown_m = 2.0 * camera["Distance"] * math.tan(math.pi / 8.0)
    low_m, high_m = {"orbit": (2.0, 2.2), "close": (0.2, 0.25)}[view]
    assert low_m < shown_m < high_m, "an arena of 2 m, or one robot"
    turned_rad = camera["Yaw"] - {"orbit": 1.5 * math.pi, "close": 0.0}[view]
    assert abs(turned_rad) < 0.01 if view == "orbit" else 0.5 < turned_rad < 0.7, "x to the right, or its front"
    hat_m, ground_m = 0.051, -0.00912
    middle_m = {"orbit": 0.0, "close": (hat_m + ground_m) / 2.0}[view]
    assert camera["Focal Point"]["Z"] == pytest.approx(middle_m, abs=2e-3)


def test_views_from_above_hold_their_arena_in_the_window():
    for view in ("map", "above"):
        config = yaml.safe_load(make_config(["hero_0"], view=view))
        scale = config["Visualization Manager"]["Views"]["Current"]["Scale"]
        # Menus, tools and the status line take 90 pixels of the height.
        assert config["Window Geometry"]["Height"] - 2.2 * scale == pytest.approx(140)
        assert config["Window Geometry"] == {"X": 0, "Y": 0, "Width": 1200, "Height": 800}


def test_the_configuration_is_written_as_rviz_writes_it():
    text = make_config(["hero_0"], "lab")
    assert text.startswith("Panels:\n- Class: rviz/Displays\n  Name: Displays\n")
    assert "\n    Fixed Frame: lab\n" in text and "{" not in text


def test_only_errors_of_localized_places_are_drawn_around_robots():
    manager = yaml.safe_load(make_config(["hero_0"], view="map"))["Visualization Manager"]
    covariances = {}

    def collect(displays):
        for display in displays:
            if "Covariance" in display:
                covariances[display["Name"]] = display["Covariance"]
            collect(display.get("Displays", []))

    collect(manager["Displays"])
    position = {"Value": True, "Scale": 3}
    assert covariances == {
        "hero_0 path": {"Value": False},
        "hero_0 pose": {"Value": True, "Orientation": {"Value": False}, "Position": position},
    }
    (path,) = [display for display in manager["Displays"] if display["Name"] == "hero_0 path"]
    assert path["Unreliable"] is False and path["Keep"] > 100 > path["Position Tolerance"] > 0


def test_the_program_becomes_rviz_with_what_its_parameters_say(monkeypatch, tmp_path):
    rviz = pytest.importorskip("hero_description.rviz", reason="imports rospy")
    ids = {"robots": [4, 6, 7], "hero_plus": [6], "simulated": [4, 6]}
    parameters = {**ids, "fixed_frame": "odom", "view": "above", "picture": True}
    monkeypatch.setattr(rviz, "read_parameters", lambda declared: {name: parameters[name] for name in declared})
    monkeypatch.setattr(rviz, "Program", create_autospec(rviz.Program))
    monkeypatch.setattr(rviz.shutil, "which", lambda name: "/opt/" + name)
    monkeypatch.setattr(rviz.tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(rviz.sys, "argv", ["rviz", "--fullscreen"])
    monkeypatch.setattr(rviz.os, "execv", create_autospec(os.execv))
    monkeypatch.setenv("DISPLAY", ":7")
    rviz.main()
    program, (name, option, path, *others) = rviz.os.execv.call_args.args
    assert (program, name, option, others) == ("/opt/rviz", "/opt/rviz", "-d", ["--fullscreen"])
    groups = {group: ["hero_%d" % robot_id for robot_id in numbers] for group, numbers in ids.items()}
    names = groups.pop("robots")
    assert Path(path).read_text() == make_config(names, "odom", "above", True, **groups)
