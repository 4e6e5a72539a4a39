import math

import numpy as np
import pytest

from hero_node.robot_constants import TICK_M
from hero_sim.world import kinematics

HEADING = np.array([[0.6], [0.8]])


def test_without_rotation_an_arc_is_a_straight_line():
    displacements_m, heading = kinematics.follow_arcs(HEADING, np.array([[0.25]]), np.array([[0.0]]))
    assert displacements_m[0] == pytest.approx(np.array([[0.15], [0.2]]))
    assert heading.tolist() == HEADING.tolist()


def test_without_travel_an_arc_is_a_rotation_on_the_spot():
    displacements_m, heading = kinematics.follow_arcs(np.array([[1.0], [0.0]]), np.array([[0.0]]), np.array([[0.1]]))
    assert not displacements_m.any()
    assert heading == pytest.approx(np.array([[math.cos(0.1)], [math.sin(0.1)]]), abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("steps", [70, 360, 100000])
def test_a_full_circle_comes_back_whatever_the_step(steps):
    half = np.full((steps // 2, 1), 1.0)
    heading = HEADING
    for sign in (1.0, -1.0):
        displacements_m, heading = kinematics.follow_arcs(heading, half / steps, half * (2 * math.pi / steps))
        diameter_m = displacements_m.sum(axis=0)
        assert diameter_m == pytest.approx(sign * np.array([[-0.8], [0.6]]) / math.pi, abs=1e-9)  # to the left
        assert heading == pytest.approx(-sign * HEADING, abs=1e-9)


def test_several_arcs_of_several_robots_are_as_one_after_the_other():
    rng = np.random.RandomState(1)
    (travels_m, rotations_rad), headings = rng.normal(scale=0.1, size=(2, 5, 20)), rng.normal(size=(2, 20))
    together_m, ends = kinematics.follow_arcs(headings, travels_m, rotations_rad)
    for robot in range(20):
        heading = headings[:, robot, None]
        for arc in range(5):
            one = slice(arc, arc + 1), slice(robot, robot + 1)
            displacements_m, heading = kinematics.follow_arcs(heading, travels_m[one], rotations_rad[one])
            assert displacements_m[0, :, 0].tolist() == together_m[arc, :, robot].tolist()
        assert heading[:, 0].tolist() == ends[:, robot].tolist()


def test_headings_are_the_cosine_and_sine_of_any_angle():
    angles_rad = np.concatenate((np.linspace(-10, 10, 2001), np.arange(-8, 9) * (math.pi / 4), [1e5, -1e5]))
    cosine, sine = kinematics.find_heading(angles_rad)
    assert cosine == pytest.approx(np.cos(angles_rad), abs=1e-15)
    assert sine == pytest.approx(np.sin(angles_rad), abs=1e-15)


def test_wheels_and_body_speeds_are_inverse():
    assert kinematics.join_wheels(*kinematics.split_to_wheels(0.1, 2.5)) == pytest.approx((0.1, 2.5))
    assert pytest.approx(0.000537, abs=1e-6) == TICK_M
