"""Exact kinematics of a differential drive, for one robot or for an array of them, and poses in the plane.

Pure: numbers and numpy only. Body frame as in REP 103: x forward, y left, angles counter-clockwise.
"""

import math
from typing import Any, NamedTuple, Tuple

import numpy as np

from ..robot_constants import WHEEL_SEPARATION_M

__all__ = ["Pose", "find_frame", "join_wheels", "move_along_arc", "split_to_wheels"]

# Below this rotation per step the arc is a straight line to within double precision.
_STRAIGHT_RAD = 1e-9

Number = Any  # a float or an array of float64; both work everywhere below


class Pose(NamedTuple):
    """A place and heading in the plane."""

    x_m: float
    y_m: float
    theta_rad: float


def find_frame(pose: Pose, seen: Pose) -> Pose:
    """Return where a frame lies in which something at pose is seen at seen."""
    theta_rad = pose.theta_rad - seen.theta_rad
    cosine, sine = math.cos(theta_rad), math.sin(theta_rad)
    x_m = pose.x_m - cosine * seen.x_m + sine * seen.y_m
    return Pose(x_m, pose.y_m - sine * seen.x_m - cosine * seen.y_m, theta_rad)


def split_to_wheels(linear_m_s: Number, angular_rad_s: Number) -> Tuple[Number, Number]:
    """Return the speeds (m/s) of the left and right wheel for this motion of the body."""
    half_m_s = angular_rad_s * (WHEEL_SEPARATION_M / 2.0)
    return linear_m_s - half_m_s, linear_m_s + half_m_s


def join_wheels(left: Number, right: Number) -> Tuple[Number, Number]:
    """Return the body's travel (m) and rotation (rad) for wheel travels (m); speeds give speeds."""
    return (left + right) / 2.0, (right - left) / WHEEL_SEPARATION_M


def move_along_arc(
    x_m: Number, y_m: Number, theta_rad: Number, left_m: Number, right_m: Number
) -> Tuple[Number, Number, Number]:
    """Return the pose after the wheels have travelled left_m and right_m at a constant ratio."""
    travel_m, rotation_rad = join_wheels(left_m, right_m)
    half_rad = np.asarray(rotation_rad) / 2.0
    straight = np.abs(half_rad) < _STRAIGHT_RAD
    # The chord of an arc of length s and angle a is s * sin(a/2) / (a/2), at the heading half way.
    chord_m = travel_m * np.where(straight, 1.0, np.sin(half_rad) / np.where(straight, 1.0, half_rad))
    heading_rad = theta_rad + half_rad
    return x_m + chord_m * np.cos(heading_rad), y_m + chord_m * np.sin(heading_rad), theta_rad + rotation_rad
