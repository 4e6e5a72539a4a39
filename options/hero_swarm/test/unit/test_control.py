"""The control loop of a behavior: where it takes robots to be, and how fast they drive while it is late."""

import math

import numpy as np
import pytest

from hero_client.controllers import Lateness
from hero_client.values import BODY_RADIUS_M
from hero_sim.stepped.swarm import StepSwarm
from hero_swarm.behavior import Behavior, Random
from hero_swarm.control import LAG_S, Control
from hero_swarm.metrics.graphs import measure_distances
from hero_swarm.safety import FENCE, ROBOTS, SafetyFilter


class Drive(Behavior):
    """Two robots on an arc to the left and one to the right."""

    def step(self, sensed, memory, random):
        return 0.1, np.array((1.0, -1.0)), memory


FAR = np.array([[(0.0, 0.0, 0.0), (3.0, 0.0, 0.0)]])
NEAR = np.array([[(0.0, 0.0, 0.0), (0.22, 0.02, math.pi)]])


def drive_far(control, step_s, steps):
    for step in range(steps):
        control.step(step * step_s, FAR, ages_s=np.zeros((1, 2)))


@pytest.mark.parametrize("age_s", [0.1, 0.22, 0.4])
def test_robots_of_old_poses_are_kept_apart_where_they_have_driven_to(age_s):
    control, safe = Control(Drive(), Random([1], 2), SafetyFilter(ROBOTS)), SafetyFilter(ROBOTS)
    drive_far(control, 0.05, 20)
    found = control.step(1.0, NEAR, ages_s=np.full((1, 2), age_s))
    linear_m_s, angular_rad_s = np.full((1, 2), 0.1), np.array([[1.0, -1.0]])
    driven_s = age_s + LAG_S
    arcs_rad = NEAR[..., 2] + 0.5 * driven_s * angular_rad_s
    moved = driven_s * np.stack((linear_m_s * np.cos(arcs_rad), linear_m_s * np.sin(arcs_rad), angular_rad_s), axis=-1)
    expected = np.array(safe(NEAR + moved, linear_m_s, angular_rad_s))[:, 0]
    share = min(1.0, 0.15 / (0.05 + age_s))
    assert np.array(found) == pytest.approx(share * expected, abs=0.01)
    assert np.abs(expected[0] - 0.1).max() > 0.1, "or they would not have met"


@pytest.mark.parametrize("late_s", [0.0, 0.4])
def test_each_command_since_the_pose_counts_for_its_time_as_it_was_sent(late_s):
    speeds_m_s = iter((0.1, 0.0, 0.05, 0.2))

    class Change(Behavior):
        def step(self, sensed, memory, random):
            return next(speeds_m_s), 0.0, memory

    safe = SafetyFilter(FENCE, np.array((-9.0, -9.0, 1.0, 9.0)))
    safe.sidestep = 0.0
    control = Control(Change(), Random([1], 1), safe)
    sent_m_s = [control.step(t_s, FAR[:, :1] - 8.0, ages_s=np.full((1, 1), late_s))[0][0] for t_s in (0.0, 0.1, 0.15)]
    assert (sent_m_s == pytest.approx([0.1, 0.0, 0.05])) == (late_s == 0.0), "robots whose poses are late are slowed"
    x_m = 1.0 - BODY_RADIUS_M - 2.0 * 0.03 - 0.012 - 0.05
    linear_m_s, _ = control.step(0.2, np.array([[(x_m, 0.0, 0.0)]]), ages_s=np.full((1, 1), 0.15 - LAG_S))
    # Since 0.05 s: 0.05 s at 0.1 m/s, 0.05 s at rest, 0.05 s at 0.05 m/s. It closes twice what is left in 1 s.
    assert linear_m_s / control.share == pytest.approx([2.0 * (0.05 - 0.05 * sum(sent_m_s))], abs=1e-6)


def test_a_simulation_that_begins_again_moves_no_robot_to_elsewhere():
    control = Control(Drive(), Random([1], 2), SafetyFilter(ROBOTS))
    drive_far(control, 0.05, 20)
    found = control.step(0.0, NEAR, ages_s=np.full((1, 2), 0.05))
    expected = SafetyFilter(ROBOTS)(NEAR, np.full((1, 2), 0.1), np.array([[1.0, -1.0]]))
    assert np.array(found) == pytest.approx(np.array(expected)[:, 0])


def test_a_late_filter_closes_no_more_than_a_share_of_what_is_left():
    planned_s = 1.0 / SafetyFilter(ROBOTS).rate_hz
    for period_s in (0.05, 0.1, 0.15, 0.333, 0.625, 0.9):
        for age_s in (0.0, 0.05, 0.2, 0.5):
            lateness = Lateness(planned_s)
            for step in range(3):
                lateness.step(step * period_s)
            share = lateness.find_share(age_s)
            assert share * SafetyFilter.gain_1_s * (period_s + age_s) < 0.6 + 1e-9, "at any speed"


class LeaveTogether(Behavior):
    """All robots drive to one place outside of the fence as fast as they can."""

    def step(self, sensed, memory, random):
        x_m, y_m, yaw_rad = sensed.poses.T
        bearing_rad = np.arctan2(-y_m, 3.0 - x_m) - yaw_rad
        return 0.2, 6.0 * (bearing_rad - 2.0 * np.pi * np.rint(bearing_rad / (2.0 * np.pi))), memory


@pytest.mark.slow
@pytest.mark.parametrize("period_s", [0.14, 0.333, 0.625, 0.9])
def test_robots_at_full_speed_whose_filter_is_late_stay_apart_and_inside(period_s):
    swarm = StepSwarm(8, seed=2)
    rows, rows_of_all = swarm.rows, np.arange(8)
    half_m = np.abs(rows.world.poses[:, :2]).max() + 0.12
    safe = SafetyFilter(ROBOTS, half_m * np.array((-1.0, -1.0, 1.0, 1.0)))
    control = Control(LeaveTogether(), Random([1], 8), safe)
    gaps_m, outside_m = [], []

    def watch(_):
        gaps_m.append(measure_distances(rows.world.poses[None, :, :2]).min() - 2.0 * BODY_RADIUS_M)
        outside_m.append(np.abs(rows.world.poses[:, :2]).max() + BODY_RADIUS_M - half_m)

    rows.on_cycle.append(watch)
    start_m = rows.world.poses[:, :2].copy()
    while rows.now_ms < 15000:
        rows.send_velocity(rows_of_all, *control.step(rows.now_ms / 1000.0, rows.world.poses[None].copy()))
        rows.advance(rows.now_ms + round(1000.0 * period_s))
    assert min(gaps_m) > 0.0 and max(outside_m) < 0.0
    assert np.hypot(*(rows.world.poses[:, :2] - start_m).T).max() > 0.1
    assert control.lateness.take_warning().startswith("commands are late by") == (period_s > 0.14)
