"""Exact kinematics of a differential drive, for one robot or for an array of them, and poses in the plane.

Pure: numbers and numpy only. Body frame as in REP 103: x forward, y left, angles counter-clockwise.
"""

import math
from typing import Any, NamedTuple, Tuple

import numpy as np

from ..robot_constants import WHEEL_SEPARATION_M

__all__ = ["Pose", "join_wheels", "move_along_arc", "split_to_wheels"]

# Below this rotation per step the arc is a straight line to within double precision.
_STRAIGHT_RAD = 1e-9

Number = Any  # a float or an array of float64; both work everywhere below


class Pose(NamedTuple):
    """A place and heading in the plane."""

    x_m: float
    y_m: float
    theta_rad: float

    def compose(self, inner: "Pose") -> "Pose":
        """Return inner, a pose relative to this one, in the frame that this one is given in."""
        cosine, sine = math.cos(self.theta_rad), math.sin(self.theta_rad)
        return Pose(
            self.x_m + cosine * inner.x_m - sine * inner.y_m,
            self.y_m + sine * inner.x_m + cosine * inner.y_m,
            self.theta_rad + inner.theta_rad,
        )

    def invert(self) -> "Pose":
        """Return the pose that undoes this one: their composition is the origin."""
        cosine, sine = math.cos(self.theta_rad), math.sin(self.theta_rad)
        x_m = -cosine * self.x_m - sine * self.y_m
        return Pose(x_m, sine * self.x_m - cosine * self.y_m, -self.theta_rad)


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
