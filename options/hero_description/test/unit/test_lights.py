"""Markers of names, rings and lights, as RViz draws them."""

import math
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

lights = pytest.importorskip("hero_description.lights", reason="imports rospy")
from std_msgs.msg import ColorRGBA  # noqa: E402
from visualization_msgs.msg import Marker  # noqa: E402

BODY_RADIUS_M, HAT_Z_M, LIGHT_S = 0.037, 0.051, 15.0
URDF = ElementTree.parse(str(Path(__file__).resolve().parents[2] / "urdf" / "hero.urdf")).getroot()


def test_a_ring_is_closed_and_lies_around_the_body():
    _, ring = lights.make_identity(7)
    ring_m = lights.HERO.body_radius_m + lights.RING_GAP_M
    angles_rad = [math.atan2(point.y, point.x) % math.tau for point in ring.points]
    radii_m = [math.hypot(point.x, point.y) for point in ring.points]
    assert radii_m == pytest.approx([ring_m] * len(radii_m))
    assert BODY_RADIUS_M + 0.004 < ring_m - ring.scale.x / 2 < ring_m < 2 * BODY_RADIUS_M
    steps_rad = {round((after - before) % math.tau, 6) for before, after in zip(angles_rad, angles_rad[1:])}
    assert steps_rad == {round(math.tau / (len(radii_m) - 1), 6)}
    assert math.degrees(steps_rad.pop()) == pytest.approx(15.0, abs=1e-3)
    assert {point.z for point in ring.points} == {0.0} and ring.type == Marker.LINE_STRIP
    assert (ring.color.a, ring.pose.orientation.w, ring.frame_locked) == (1.0, 1.0, True)


def test_the_ring_of_a_hero_plus_lies_around_its_bump_shield():
    _, ring = lights.make_identity(7, model=lights.MODELS["hero_plus"])
    assert math.hypot(ring.points[0].x, ring.points[0].y) == pytest.approx(0.060 + 0.008)


def test_lights_names_and_rings_of_a_simulated_robot_are_where_it_is():
    markers = [lights.make_light(7, ColorRGBA(1.0, 0.0, 0.0, 1.0), "true/"), *lights.make_identity(7, "true/")]
    frames = [marker.header.frame_id for marker in markers]
    assert frames == ["hero_7/true/hat_link", "hero_7/true/base_link", "hero_7/true/base_link"]


def test_a_name_stands_above_the_hat_in_dark_letters():
    name, _ = lights.make_identity(7)
    assert HAT_Z_M + name.scale.z / 2 < name.pose.position.z < 0.2
    assert name.scale.z > 0.01
    assert max(name.color.r, name.color.g, name.color.b) < 0.2
    assert (name.color.a, name.pose.orientation.w, name.frame_locked) == (1.0, 1.0, True)


def test_a_light_has_its_color_for_as_long_as_the_firmware_shows_it():
    light = lights.make_light(3, ColorRGBA(0.0, 0.5, 0.0, 0.2))
    assert (light.color.r, light.color.g, light.color.b, light.color.a) == (0.0, 0.5, 0.0, 1.0)
    assert (light.action, light.header.frame_id) == (light.ADD, "hero_3/hat_link")
    assert light.lifetime.to_sec() == LIGHT_S
    assert light.scale.x == light.scale.y == light.scale.z
    assert 0.01 < light.scale.x < 2 * BODY_RADIUS_M
    dark = URDF.find("link[@name='hat_link']/visual[@name='light']")
    assert light.pose.position.z == float(dark.find("origin").get("xyz").split()[2])
    assert 2.0 * float(dark.find("geometry/sphere").get("radius")) < light.scale.x < 0.03, "covers the dark one"
    assert lights.make_light(3, ColorRGBA(0.0, 0.0, 0.0, 1.0)).action == light.DELETE
    for color in (ColorRGBA(0.1, 0.0, 0.0, 1.0), ColorRGBA(0.0, 0.0, 0.1, 1.0)):
        assert lights.make_light(3, color).action == light.ADD
