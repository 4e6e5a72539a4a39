"""Markers of names, rings and lights, as RViz draws them."""

import math

import pytest

lights = pytest.importorskip("hero_description.lights", reason="imports rospy")
from std_msgs.msg import ColorRGBA  # noqa: E402

BODY_RADIUS_M, HAT_Z_M, LIGHT_S = 0.037, 0.051, 15.0


def test_a_ring_is_closed_and_lies_around_the_body():
    _, ring = lights.make_identity(7)
    angles_rad = [math.atan2(point.y, point.x) % math.tau for point in ring.points]
    radii_m = [math.hypot(point.x, point.y) for point in ring.points]
    assert radii_m == pytest.approx([lights.RING_RADIUS_M] * len(radii_m))
    assert BODY_RADIUS_M < lights.RING_RADIUS_M - ring.scale.x / 2 < lights.RING_RADIUS_M < 2 * BODY_RADIUS_M
    steps_rad = {round((after - before) % math.tau, 6) for before, after in zip(angles_rad, angles_rad[1:])}
    assert steps_rad == {round(math.tau / (len(radii_m) - 1), 6)}
    assert {point.z for point in ring.points} == {0.0}
    assert (ring.color.a, ring.pose.orientation.w, ring.frame_locked) == (1.0, 1.0, True)


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
    assert lights.make_light(3, ColorRGBA(0.0, 0.0, 0.0, 1.0)).action == light.DELETE
