"""Poses and frames in the plane."""

import cmath
import itertools
import math
from types import SimpleNamespace

import pytest

from hero_node.geometry import (
    STOP,
    Pose,
    clamp,
    find_frame,
    invert_pose,
    measure_distance,
    transform_pose,
    wrap_angle,
    yaw_of,
)

POSES = [Pose(*values) for values in itertools.product((-1.5, 0.0, 2.0), (-0.5, 3.0), (-2.5, 0.0, 0.3, 3.0))]


def to_complex(pose):
    """Return place and direction of a pose as complex numbers."""
    return complex(pose.x_m, pose.y_m), cmath.rect(1.0, pose.yaw_rad)


def test_a_frame_is_found_from_where_something_in_it_is_and_is_seen():
    # A quarter turn to the left and one meter forward of a frame at (1, 0), which is turned to the left, too.
    pose = Pose(1.0, 1.0, math.pi)
    frame = find_frame(pose, Pose(1.0, 0.0, math.pi / 2))
    assert frame == pytest.approx((1.0, 0.0, math.pi / 2))
    assert find_frame(pose, Pose(0.0, 0.0, 0.0)) == pytest.approx(pose)


@pytest.mark.parametrize("origin", POSES)
def test_frames_turn_and_shift_as_complex_numbers_do(origin):
    place, direction = to_complex(origin)
    for pose in POSES:
        inner_place, inner_direction = to_complex(pose)
        outer = transform_pose(origin, pose)
        assert to_complex(outer) == pytest.approx((place + direction * inner_place, direction * inner_direction))
        assert -math.pi <= outer.yaw_rad <= math.pi
        assert transform_pose(invert_pose(origin), outer) == pytest.approx(pose)
        assert to_complex(find_frame(outer, pose)) == pytest.approx((place, direction))
        assert measure_distance(origin, pose) == pytest.approx(abs(inner_place - place))


@pytest.mark.parametrize("yaw_rad", [-3.0, -1.0, 0.0, 0.5, 3.1])
@pytest.mark.parametrize("tilt_rad", [0.0, 0.4])
@pytest.mark.parametrize("axis", "xy")
def test_the_yaw_of_an_orientation_is_its_turn_about_z(yaw_rad, tilt_rad, axis):
    # First the tilt about x or y, then the turn about z: (w, x, y, z) of the product of both quaternions.
    cos, sin = math.cos(yaw_rad / 2), math.sin(yaw_rad / 2)
    tilt_cos, tilt_sin = math.cos(tilt_rad / 2), math.sin(tilt_rad / 2)
    x, y = (cos * tilt_sin, sin * tilt_sin) if axis == "x" else (-sin * tilt_sin, cos * tilt_sin)
    assert yaw_of(SimpleNamespace(w=cos * tilt_cos, x=x, y=y, z=sin * tilt_cos)) == pytest.approx(yaw_rad)


def test_angles_and_values_are_cut_to_their_limits():
    for turns in (-2, 0, 1):
        assert wrap_angle(1.0 + turns * math.tau) == pytest.approx(1.0)
    assert [clamp(value, 2.0) for value in (-3.0, -2.0, -1.0, 1.0, 2.0, 3.0)] == [-2.0, -2.0, -1.0, 1.0, 2.0, 2.0]


def test_a_stop_asks_for_no_motion_at_all():
    assert STOP == (0.0, 0.0) and repr(STOP) == "Velocity(linear_m_s=0.000, angular_rad_s=0.000)"
