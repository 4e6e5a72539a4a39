import math

import numpy as np
import pytest

from hero_node.robot_constants import TICK_M
from hero_sim.world import body_loops, kinematics

HEADING = np.array([0.6, 0.8])


def follow(heading, travel_m, rotation_rad):
    """Return the displacement along an arc, and the heading behind it, as arrays (2,)."""
    moved = body_loops.follow_arc(*heading, *body_loops.shape_arc(travel_m, rotation_rad))
    return np.array(moved[:2]), np.array(moved[2:])


def test_without_rotation_an_arc_is_a_straight_line():
    displacement_m, heading = follow(HEADING, 0.25, 0.0)
    assert displacement_m == pytest.approx(np.array([0.15, 0.2]))
    assert heading.tolist() == HEADING.tolist()


def test_without_travel_an_arc_is_a_rotation_on_the_spot():
    displacement_m, heading = follow(np.array([1.0, 0.0]), 0.0, 0.1)
    assert not displacement_m.any()
    assert heading == pytest.approx(np.array([math.cos(0.1), math.sin(0.1)]), abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("steps", [70, 360, 100000])
def test_a_full_circle_comes_back_whatever_the_step(steps):
    heading = HEADING
    for sign in (1.0, -1.0):
        diameter_m = np.zeros(2)
        for _ in range(steps // 2):
            displacement_m, heading = follow(heading, 1.0 / steps, 2 * math.pi / steps)
            diameter_m += displacement_m
        assert diameter_m == pytest.approx(sign * np.array([-0.8, 0.6]) / math.pi, abs=1e-9)  # to the left
        assert heading == pytest.approx(-sign * HEADING, abs=1e-9)


def test_headings_are_the_cosine_and_sine_of_any_angle():
    angles_rad = np.concatenate((np.linspace(-10, 10, 2001), np.arange(-8, 9) * (math.pi / 4), [1e5, -1e5]))
    cosine, sine = kinematics.find_heading(angles_rad)
    assert cosine == pytest.approx(np.cos(angles_rad), abs=1e-15)
    assert sine == pytest.approx(np.sin(angles_rad), abs=1e-15)


def test_wheels_and_body_speeds_are_inverse():
    assert kinematics.join_wheels(*kinematics.split_to_wheels(0.1, 2.5)) == pytest.approx((0.1, 2.5))
    assert pytest.approx(0.000537, abs=1e-6) == TICK_M
