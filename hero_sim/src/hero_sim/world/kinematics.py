"""Kinematics of a differential drive, for one robot or for an array of them.

Pure: numbers and numpy only. Body frame as in REP 103: x forward, y left, angles counter-clockwise.
What a simulated world is computed with uses only + - * / and rounding, which IEEE 754 defines to the last bit:
numpy's sine and cosine differ between versions and processors.
"""

import math
from typing import Any, Sequence, Tuple

import numpy as np

from hero_node.robot_constants import WHEEL_SEPARATION_M

# Half pi in two parts, of which the first, with 33 bits, gives exact products with small whole numbers.
_HALF_PI_HIGH = float.fromhex("0x1.921fb544p+0")
_HALF_PI_LOW = float.fromhex("0x1.0b4611a626331p-34")

_SINE_TERMS = [(-1.0) ** n / math.factorial(2 * n + 1) for n in range(9)]
_COSINE_TERMS = [(-1.0) ** n / math.factorial(2 * n) for n in range(9)]
"""Taylor series in the square of the angle."""

Number = Any  # a float or an array of float64; both work everywhere below


def split_to_wheels(linear_m_s: Number, angular_rad_s: Number) -> Tuple[Number, Number]:
    """Return the speeds (m/s) of the left and right wheel for this motion of the body."""
    half_m_s = angular_rad_s * (WHEEL_SEPARATION_M / 2.0)
    return linear_m_s - half_m_s, linear_m_s + half_m_s


def join_wheels(left: Number, right: Number, separation_m: Number = WHEEL_SEPARATION_M) -> Tuple[Number, Number]:
    """Return the body's travel (m) and rotation (rad) for wheel travels (m); speeds give speeds."""
    return (left + right) / 2.0, (right - left) / separation_m


def _sum_series(terms: Sequence[float], variable: Number) -> Number:
    total = terms[-1]
    for term in reversed(terms[:-1]):
        total = total * variable + term
    return total


def find_heading(theta_rad: Number) -> Tuple[np.ndarray, np.ndarray]:
    """Return cosine and sine of angles up to 1e6 rad, the same bits on every machine."""
    quarters = np.rint(theta_rad * (2.0 / math.pi))
    rest_rad = (theta_rad - quarters * _HALF_PI_HIGH) - quarters * _HALF_PI_LOW
    square = rest_rad * rest_rad
    sine, cosine = rest_rad * _sum_series(_SINE_TERMS, square), _sum_series(_COSINE_TERMS, square)
    turn = quarters - 4.0 * np.floor(quarters / 4.0)
    swapped, sign = (turn == 1.0) | (turn == 3.0), np.where(turn >= 2.0, -1.0, 1.0)
    return sign * np.where(swapped, -sine, cosine), sign * np.where(swapped, cosine, sine)
