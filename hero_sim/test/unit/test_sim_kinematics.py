import math

import numpy as np
import pytest

from hero_sim.robot_constants import TICK_M
from hero_sim.world import kinematics


def test_equal_wheels_drive_straight():
    x_m, y_m, theta_rad = kinematics.move_along_arc(0.0, 0.0, math.pi / 2, 0.25, 0.25)
    assert (x_m, y_m, theta_rad) == pytest.approx((0.0, 0.25, math.pi / 2))


def test_opposite_wheels_spin_on_the_spot():
    x_m, y_m, theta_rad = kinematics.move_along_arc(1.0, 2.0, 0.0, -0.063 * math.pi / 2, 0.063 * math.pi / 2)
    assert (x_m, y_m, theta_rad) == pytest.approx((1.0, 2.0, math.pi))


@pytest.mark.parametrize("steps", [1, 7, 360])
def test_a_full_circle_comes_back_whatever_the_step(steps):
    radius_m = 0.2
    left_m, right_m = kinematics.split_to_wheels(2 * math.pi * radius_m, 2 * math.pi)
    pose = (0.3, -0.1, 0.4)
    for _ in range(steps):
        pose = kinematics.move_along_arc(*pose, left_m / steps, right_m / steps)
    assert pose == pytest.approx((0.3, -0.1, 0.4 + 2 * math.pi))


def test_half_a_circle_ends_two_radii_aside():
    left_m, right_m = kinematics.split_to_wheels(math.pi * 0.5, math.pi)
    assert kinematics.move_along_arc(0.0, 0.0, 0.0, left_m, right_m) == pytest.approx((0.0, 1.0, math.pi))


def test_arrays_move_like_single_robots():
    rng = np.random.RandomState(1)
    start, wheels = rng.normal(size=(20, 3)), rng.normal(size=(20, 2))
    together = np.column_stack(kinematics.move_along_arc(*start.T, *wheels.T))
    alone = [kinematics.move_along_arc(*pose, *pair) for pose, pair in zip(start, wheels)]
    assert np.allclose(together, alone)


def test_wheels_and_body_speeds_are_inverse():
    assert kinematics.join_wheels(*kinematics.split_to_wheels(0.1, 2.5)) == pytest.approx((0.1, 2.5))
    assert pytest.approx(0.000537, abs=1e-6) == TICK_M


def test_a_frame_is_found_from_where_something_in_it_is_and_is_seen():
    # A quarter turn to the left and one meter forward of a frame at (1, 0), which is turned to the left, too.
    pose = kinematics.Pose(1.0, 1.0, math.pi)
    frame = kinematics.find_frame(pose, kinematics.Pose(1.0, 0.0, math.pi / 2))
    assert frame == pytest.approx((1.0, 0.0, math.pi / 2))
    assert kinematics.find_frame(pose, kinematics.Pose(0.0, 0.0, 0.0)) == pytest.approx(pose)
