"""Wheel travel -> pose of a differential drive, exactly, for one robot or for an array of them.

Pure: numbers and numpy only. Body frame as in REP 103: x forward, y left, angles counter-clockwise.
"""

import math
from typing import Any, Tuple

import numpy as np

from ..robot_constants import WHEEL_SEPARATION_M

# Below this turn per step the arc is a straight line to within double precision.
_STRAIGHT_RAD = 1e-9

Number = Any  # a float or an array of float64; both work everywhere below


def split_to_wheels(linear_m_s: Number, turn_rad_s: Number) -> Tuple[Number, Number]:
    """Return the speeds (m/s) of the left and right wheel that give this motion of the body."""
    half_m_s = turn_rad_s * (WHEEL_SEPARATION_M / 2.0)
    return linear_m_s - half_m_s, linear_m_s + half_m_s


def join_wheels(left: Number, right: Number) -> Tuple[Number, Number]:
    """Return body travel (m) and turn (rad) for wheel travels (m); speeds give speeds."""
    return (left + right) / 2.0, (right - left) / WHEEL_SEPARATION_M


def move_along_arc(
    x_m: Number, y_m: Number, theta_rad: Number, left_m: Number, right_m: Number
) -> Tuple[Number, Number, Number]:
    """Return the pose after the wheels have travelled left_m and right_m at a constant ratio."""
    travel_m, turn_rad = join_wheels(left_m, right_m)
    half_rad = np.asarray(turn_rad) / 2.0
    straight = np.abs(half_rad) < _STRAIGHT_RAD
    # The chord of an arc of length s and angle a is s * sin(a/2) / (a/2), at the heading half way.
    chord_m = travel_m * np.where(straight, 1.0, np.sin(half_rad) / np.where(straight, 1.0, half_rad))
    heading_rad = theta_rad + half_rad
    return x_m + chord_m * np.cos(heading_rad), y_m + chord_m * np.sin(heading_rad), theta_rad + turn_rad


Pose = Tuple[float, float, float]


def compose(frame: Pose, inner: Pose) -> Pose:
    """Return the pose inner, which is given in frame, in whatever frame is given in."""
    cosine, sine = math.cos(frame[2]), math.sin(frame[2])
    return (
        frame[0] + cosine * inner[0] - sine * inner[1],
        frame[1] + sine * inner[0] + cosine * inner[1],
        frame[2] + inner[2],
    )


def invert(pose: Pose) -> Pose:
    """Return the pose that undoes pose: compose(pose, invert(pose)) is the origin."""
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    return (-cosine * pose[0] - sine * pose[1], sine * pose[0] - cosine * pose[1], -pose[2])
