"""Loops over wheels that roll, with the random numbers of their steps, and over their encoders.

Pure; numbers or arrays. numba compiles this file where it is installed (compiled.py), so what the loops call is here.
"""

import math
from typing import Any

import numpy as np

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1, _MIX_2 = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_27, _30, _31, _16, _32 = (np.uint64(bits) for bits in (27, 30, 31, 16, 32))
_LANES = np.uint64(0x0000FFFF0000FFFF)
_SUM = np.uint64(0xFFFFFFFF)
_NORMAL_SCALE = 1.0 / math.sqrt((65536.0 * 65536.0 - 1.0) / 3.0)
_NORMAL_MEAN = 2.0 * 65535.0 * _NORMAL_SCALE


def draw_normal_at(key: Any, place: Any) -> Any:
    """Return the random numbers at places of a stream, whole numbers or an array of them.

    Nearly normal, mean 0, standard deviation 1, never beyond 3.5: the sum of four uniform numbers, the 64 bits of
    SplitMix64 (Steele, Lea and Flood 2014), which needs no drawing of those before.
    """
    bits = key + np.uint64(place) * _GOLDEN
    bits = (bits ^ (bits >> _30)) * _MIX_1
    bits = (bits ^ (bits >> _27)) * _MIX_2
    bits = bits ^ (bits >> _31)
    bits = (bits & _LANES) + ((bits >> _16) & _LANES)
    return ((bits & _SUM) + (bits >> _32)) * _NORMAL_SCALE - _NORMAL_MEAN


def find_place(step: Any, channel: Any, robot: Any) -> Any:
    """Return the place of a random number in a world's stream: in each step, a robot has four channels."""
    return ((step * 4 + channel) << 16) + robot


def drive_wheel(speed_m_s: Any, command_m_s: Any, ripple_m_s: Any, share: Any) -> Any:
    """Return the speed of a wheel after a step: it takes a share of the difference to its command, which ripples."""
    return speed_m_s + (command_m_s + ripple_m_s * (command_m_s != 0.0) - speed_m_s) * share


def roll_wheels(
    keys: Any, first_step: int, wheels: Any, commands_m_s: Any, spreads: Any, ground_m: Any, step_s: float
) -> None:
    """Move the wheels of all worlds on by the steps of ground_m (K, 2, R), where the bodies' ways over the ground go.

    wheels (4, R): travels and speeds. spreads (8, R): ripple, slip, scale and share of the left and the right wheels.
    """
    steps, _, rows = ground_m.shape
    robots = rows // len(keys)
    for world in range(len(keys)):
        begin, end = world * robots, (world + 1) * robots
        for wheel in range(2):
            travels_m, speeds_m_s = wheels[wheel, begin:end], wheels[2 + wheel, begin:end]
            ripples, slips = spreads[wheel, begin:end], spreads[2 + wheel, begin:end]
            scales, shares = spreads[4 + wheel, begin:end], spreads[6 + wheel, begin:end]
            own_m_s = commands_m_s[wheel, begin:end]
            for step in range(steps):
                rolled_m, number = ground_m[step, wheel, begin:end], first_step + step
                for robot in range(robots):  # without a branch, several at once
                    speed_m_s = speeds_m_s[robot]
                    slip = draw_normal_at(keys[world], find_place(number, 2 + wheel, robot)) * slips[robot]
                    ripple_m_s = draw_normal_at(keys[world], find_place(number, wheel, robot)) * ripples[robot]
                    travels_m[robot] += speed_m_s * step_s
                    rolled_m[robot] = speed_m_s * ((1.0 - abs(slip)) * scales[robot])
                    speeds_m_s[robot] = drive_wheel(speed_m_s, own_m_s[robot], ripple_m_s, shares[robot])


def read_encoders(
    since_s: float, elapsed_s: Any, noise_s_m: float, which: Any, travels_m: Any, speeds_m_s: Any, tick_m: Any,
    base_ticks: Any, ticks: Any, filtered_m_s: Any, errors: Any,
) -> None:  # fmt: skip
    """Do what WheelEncoders.read() does, for the robots which: a mask (R,)."""
    for wheel in range(2):
        for robot in range(len(which)):
            counted = np.floor((speeds_m_s[wheel, robot] * since_s + travels_m[wheel, robot]) / tick_m[robot])
            counted -= base_ticks[wheel, robot]
            speed_m_s = (counted - ticks[wheel, robot]) * tick_m[robot] / elapsed_s[robot]
            gain = errors[wheel, robot] / (errors[wheel, robot] + 1.0)
            change_m_s = (speed_m_s - filtered_m_s[wheel, robot]) * gain
            if which[robot]:
                ticks[wheel, robot] = counted
                errors[wheel, robot] = abs(change_m_s) * noise_s_m + gain
                filtered_m_s[wheel, robot] += change_m_s
