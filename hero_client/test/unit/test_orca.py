"""Reciprocal avoidance: robots with two wheels and slow motors swap places without touching."""

import math

import numpy as np
import pytest
from test_controllers import STEP_S, Body

from hero_client.controllers.half_planes import nearest_allowed, steer
from hero_client.controllers.orca import AvoidanceLaw, avoid_sensed, keep_apart
from hero_client.controllers.swarm_go_to import SwarmGoToController
from hero_node import STOP, Pose
from hero_node.robot_constants import BODY_RADIUS_M
from hero_test.nonempty import nonempty


def place_point(x_m, y_m, yaw_rad, lookahead_m):
    return np.array([x_m + lookahead_m * math.cos(yaw_rad), y_m + lookahead_m * math.sin(yaw_rad)])


def test_the_steered_point_moves_with_the_velocity_that_is_asked_for():
    law, (x_m_s, y_m_s), step_s = AvoidanceLaw(), (0.03, -0.02), 1e-6
    for yaw_rad in np.linspace(-3.0, 3.0, 13):
        cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
        linear_m_s, angular_rad_s = steer(
            cos * x_m_s + sin * y_m_s, cos * y_m_s - sin * x_m_s, law.max_linear_m_s, law.lookahead_m
        )
        x_m, y_m = 0.3 + linear_m_s * step_s * cos, -0.2 + linear_m_s * step_s * sin
        change_m = place_point(x_m, y_m, yaw_rad + angular_rad_s * step_s, law.lookahead_m)
        change_m -= place_point(0.3, -0.2, yaw_rad, law.lookahead_m)
        np.testing.assert_allclose(change_m / step_s, (x_m_s, y_m_s), atol=1e-6)


def test_a_half_plane_holds_exactly_what_leads_to_a_meeting():
    rng = np.random.RandomState(1)
    for _ in range(300):
        offset = rng.uniform(-0.5, 0.5, 2)
        radius_m, horizon_s = 0.15, 3.0
        if np.hypot(*offset) < radius_m + 0.01:
            continue
        velocity = rng.uniform(-0.2, 0.2, 2)
        normal, depth = keep_apart(offset, velocity, radius_m, horizon_s, 0.1)
        times = np.linspace(0.0, horizon_s, 3001)
        nearest_m = np.min(np.hypot(*(offset[:, None] - velocity[:, None] * times)))
        if abs(nearest_m - radius_m) > 0.001:
            assert (depth > 0.0) == (nearest_m < radius_m)
        changed = velocity + normal * depth  # the smallest change leads exactly past
        nearest_m = np.min(np.hypot(*(offset[:, None] - changed[:, None] * times)))
        assert nearest_m == pytest.approx(radius_m, abs=0.001)


def swap(count, radius_m, seed):
    """Return (least distance of two centers, poses, goals) of count robots that swap places across a circle."""
    rng = np.random.RandomState(seed)
    angles = 2.0 * math.pi * np.arange(count) / count
    poses = [Pose(radius_m * math.cos(a), radius_m * math.sin(a), rng.uniform(-math.pi, math.pi)) for a in angles]
    goals = [(-pose.x_m, -pose.y_m) for pose in poses]
    bodies = [Body(pose) for pose in poses]
    steering = SwarmGoToController(goals, AvoidanceLaw(), STEP_S)
    min_distance_m = math.inf
    for _ in range(1500):
        commands = steering.step([body.pose for body in bodies])
        for body, command in zip(bodies, commands):
            body.step(command)
        places = np.array([body.pose[:2] for body in bodies])
        apart = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1)) + np.eye(count)
        min_distance_m = min(min_distance_m, float(apart.min()))
        if all(command == STOP for command in commands):
            break
    return min_distance_m, [body.pose for body in bodies], goals


@pytest.mark.slow
def test_robots_swap_places_across_a_circle_without_touching():
    for count, radius_m, seeds in ((2, 0.4, 4), (3, 0.4, 4), (10, 0.6, 1)):
        for seed in range(seeds):
            min_distance_m, poses, goals = swap(count, radius_m, seed)
            assert min_distance_m > 2.0 * BODY_RADIUS_M
            for pose, goal in nonempty(zip(poses, goals)):
                assert math.hypot(pose.x_m - goal[0], pose.y_m - goal[1]) < 0.02


def avoid(yaw_rad, ranges, ahead, law):
    """Return the velocity of one robot that is nearest to ahead."""
    wanted, normals, bounds = avoid_sensed(np.array([yaw_rad]), [ranges], np.array([ahead]), law)
    return nearest_allowed(wanted, normals, bounds, law.max_linear_m_s)[0]


def test_what_is_seen_near_is_not_driven_at_but_passed_on_the_right():
    law = AvoidanceLaw()
    for gap_m in (0.09, 0.05, 0.03, 0.01):
        found = avoid(math.pi / 2.0, [law.body_m + gap_m] + [math.inf] * 7, (0.0, 0.08), law)
        limit_m_s = max(gap_m - law.clearance_m, -law.back_off_m_s)
        assert found[1] <= limit_m_s + 1e-3
        assert found[0] > 0.0  # the right of a robot that looks along y


@pytest.mark.parametrize("range_m", [0.0, 0.047, 0.06])
@pytest.mark.parametrize("speed_m_s", [0.08, 0.0])
def test_a_robot_backs_off_at_the_documented_speed_from_what_touches(range_m, speed_m_s):
    law = AvoidanceLaw()
    found = avoid(0.0, [range_m] + [math.inf] * 7, (speed_m_s, 0.0), law)
    away_m_s = min(law.back_off_m_s, law.body_m + law.clearance_m - range_m)
    assert found[0] == pytest.approx(-away_m_s, abs=1e-3)


def test_what_is_far_or_not_known_changes_nothing():
    law, ahead = AvoidanceLaw(), np.array([(0.08, 0.0)] * 4)
    far = law.body_m + law.sense_m + 0.01
    wanted, _, bounds = avoid_sensed(np.zeros(4), [[math.inf] * 8, [math.nan] * 8, [far] * 8, ()], ahead, law)
    assert (wanted == ahead).all() and (bounds == -math.inf).all()
