import math

import numpy as np
import pytest

from hero_sim.robot_constants import TICK_M
from hero_sim.world import kinematics


def test_without_rotation_an_arc_is_a_straight_line():
    assert kinematics.move_along_arc(0.0, 0.0, 0.6, 0.8, 0.25, 0.0) == pytest.approx((0.15, 0.2, 0.6, 0.8))


def test_without_travel_an_arc_is_a_rotation_on_the_spot():
    end = kinematics.move_along_arc(1.0, 2.0, 1.0, 0.0, 0.0, 0.1)
    assert end == pytest.approx((1.0, 2.0, math.cos(0.1), math.sin(0.1)), abs=1e-12)


@pytest.mark.parametrize("steps", [70, 360, 100000])
def test_a_full_circle_comes_back_whatever_the_step(steps):
    start = end = (0.3, -0.1, 0.6, 0.8)
    for step in range(steps):
        end = kinematics.move_along_arc(*end, 1.0 / steps, 2 * math.pi / steps)
        if step == steps // 2 - 1:  # a diameter to the left
            assert end == pytest.approx((0.3 - 0.8 / math.pi, -0.1 + 0.6 / math.pi, -0.6, -0.8), abs=1e-9)
    assert end == pytest.approx(start, abs=1e-9)


def test_arrays_move_like_single_robots():
    rng = np.random.RandomState(1)
    values = rng.normal(scale=0.1, size=(20, 6))
    together = np.column_stack(kinematics.move_along_arc(*values.T))
    assert together.tolist() == [list(kinematics.move_along_arc(*row)) for row in values.tolist()]


def test_headings_are_the_cosine_and_sine_of_any_angle():
    angles_rad = np.concatenate((np.linspace(-10, 10, 2001), np.arange(-8, 9) * (math.pi / 4), [1e5, -1e5]))
    cosine, sine = kinematics.find_heading(angles_rad)
    assert cosine == pytest.approx(np.cos(angles_rad), abs=1e-15)
    assert sine == pytest.approx(np.sin(angles_rad), abs=1e-15)


def test_wheels_and_body_speeds_are_inverse():
    assert kinematics.join_wheels(*kinematics.split_to_wheels(0.1, 2.5)) == pytest.approx((0.1, 2.5))
    assert pytest.approx(0.000537, abs=1e-6) == TICK_M


def test_a_frame_is_found_from_where_something_in_it_is_and_is_seen():
    # A quarter turn to the left and one meter forward of a frame at (1, 0), which is turned to the left, too.
    pose = kinematics.Pose(1.0, 1.0, math.pi)
    frame = kinematics.find_frame(pose, kinematics.Pose(1.0, 0.0, math.pi / 2))
    assert frame == pytest.approx((1.0, 0.0, math.pi / 2))
    assert kinematics.find_frame(pose, kinematics.Pose(0.0, 0.0, 0.0)) == pytest.approx(pose)
