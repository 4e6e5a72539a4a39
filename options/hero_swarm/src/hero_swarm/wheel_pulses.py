"""Servo pulses for wheel speeds, past the firmware's velocity controller. Pure: arrays over R robots.

With the gains of an erased flash, that controller brings a wheel to 60 % of a new speed at once and needs a second for
the rest; behaviors that change their wheel speeds several times a second need wheels that follow at once.
"""

from typing import Any, Tuple

import numpy as np

from hero_sim.world import MAX_WHEEL_M_S, SERVO_GAIN_M_S_US, RobotErrors, split_to_wheels


def list_dead_zones(errors: RobotErrors) -> np.ndarray:
    """Return the dead zones of simulated robots that are calibrated: see find_pulses()."""
    centers_us, half_us = np.rint(errors.servo_center_us), errors.dead_zone_us
    edges_us = np.stack((centers_us - half_us, centers_us + half_us), axis=-1)
    return edges_us.reshape(len(centers_us), 4)


def find_pulses(linear_m_s: Any, angular_rad_s: Any, dead_zones_us: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return the pulses (us, whole numbers) of the left and right servos (R,) for speeds, each a number or (R,).

    dead_zones_us (R, 4): lower and upper edge of the left servo's dead zone, then of the right one's, as `calibrate
    motors` finds them. Beyond them all servos count as equally fast. A wheel without speed gets the middle; faster
    ones than MAX_WHEEL_M_S turn as fast as they can.
    """
    left_m_s, right_m_s = (
        np.minimum(np.maximum(wheel_m_s, -MAX_WHEEL_M_S), MAX_WHEEL_M_S)
        for wheel_m_s in split_to_wheels(linear_m_s, angular_rad_s)
    )
    low_left_us, high_left_us, low_right_us, high_right_us = dead_zones_us.T
    # The servos are mounted as mirror images: the left one drives forward below its center.
    return (
        _leave_dead_zone(low_left_us, high_left_us, -left_m_s / SERVO_GAIN_M_S_US),
        _leave_dead_zone(low_right_us, high_right_us, right_m_s / SERVO_GAIN_M_S_US),
    )


def _leave_dead_zone(low_us: np.ndarray, high_us: np.ndarray, beyond_us: Any) -> np.ndarray:
    from_us = np.where(beyond_us > 0.0, high_us, np.where(beyond_us < 0.0, low_us, (low_us + high_us) / 2.0))
    pulses_us: np.ndarray = np.rint(from_us + beyond_us)
    return pulses_us
