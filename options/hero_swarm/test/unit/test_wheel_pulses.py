"""Servo pulses for speeds: mirrored wheels, dead zones, and wheels that follow sooner than velocities."""

import numpy as np
import pytest

from hero_sim.world import MAX_WHEEL_M_S, join_wheels
from hero_swarm.behavior import PULSES, VELOCITY, Behavior
from hero_swarm.trial import Trial
from hero_swarm.wheel_pulses import find_pulses, list_dead_zones

DEAD_ZONES_US = np.array([(1470.0, 1530.0, 1480.0, 1540.0)] * 3)


class Turnabout(Behavior):
    """Both wheels at 0.1 m/s, after 2 s in the other direction."""

    rate_hz = 1000.0 / 60.0

    def step(self, sensed, memory, random):
        sign = 1.0 if sensed.time_s < 2.0 else -1.0
        linear_m_s, angular_rad_s = join_wheels(np.full(len(sensed.poses), 0.1 * sign), 0.1 * sign)
        return linear_m_s, angular_rad_s + 0.0 * linear_m_s, memory


def test_pulses_leave_the_dead_zones_as_the_mirrored_servos_need():
    left_us, right_us = find_pulses(np.array([0.1, -0.1, 0.0]), np.array([0.0, 0.0, 0.0]), DEAD_ZONES_US)
    assert left_us.tolist() == [1470 - 88, 1530 + 88, 1500]
    assert right_us.tolist() == [1540 + 88, 1480 - 88, 1510]
    # In a turn to the left, the left wheel goes backward: both pulses are above their centers.
    left_us, right_us = find_pulses(0.0, 2.0, DEAD_ZONES_US)
    assert (left_us > 1530).all() and (right_us > 1540).all()


def test_pulses_for_impossible_speeds_are_those_of_the_fastest_wheels():
    fastest_us = find_pulses(MAX_WHEEL_M_S, 0.0, DEAD_ZONES_US)
    assert np.array_equal(find_pulses(50.0, 0.0, DEAD_ZONES_US), fastest_us)
    assert 1000 < fastest_us[0][0] < 1470 and 1540 < fastest_us[1][0] < 2000
    left_us, right_us = find_pulses(0.0, -1e9, DEAD_ZONES_US)
    assert left_us[0] == fastest_us[0][0] and 1000 < right_us[0] < 1480


@pytest.mark.parametrize("drive", [PULSES, VELOCITY])
def test_wheels_reverse_within_a_third_of_a_second_by_pulses_only(drive):
    trial = Trial(Turnabout(drive=drive), robots=4, seeds=(1,))
    while trial.rows.now_ms < 2400:
        trial.step()
    reached = -trial.rows.world.speeds_m_s / 0.1
    assert (reached.min() > 0.85) == (drive == PULSES), reached


def test_simulated_robots_rest_within_their_dead_zones():
    errors = Trial(Turnabout(), robots=5, seeds=(3,)).rows.world.errors
    zones_us = list_dead_zones(errors)
    assert zones_us[:, 1] - zones_us[:, 0] == pytest.approx(60.0)
    assert np.abs(zones_us[:, (0, 2)] + 30.0 - errors.servo_center_us).max() <= 0.5


def test_a_way_to_drive_that_is_none_is_refused():
    with pytest.raises(ValueError, match="drive is 'wheels', but must be velocity or pulses"):
        Turnabout(drive="wheels")
