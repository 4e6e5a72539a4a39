"""The safety filter: no touch, where robots without it touch; and nothing changed where nothing is near."""

import math

import numpy as np
import pytest

from hero_client.controllers.half_planes import nearest_allowed_all
from hero_client.values.robot_constants import BODY_RADIUS_M
from hero_swarm.behavior import Behavior
from hero_swarm.metrics.graphs import measure_distances
from hero_swarm.safety import OFF, ROBOTS, SafetyFilter
from hero_swarm.trial import OPEN, Trial

FENCE_M = np.array((-0.7, -0.7, 0.7, 0.7))


class RandomWalk(Behavior):
    def step(self, sensed, memory, random):
        turn_rad_s = random.normal() if memory is None else 0.95 * memory + 0.4 * random.normal()
        return np.full(len(turn_rad_s), 0.12), turn_rad_s, turn_rad_s


@pytest.mark.parametrize("mode", [OFF, ROBOTS])
def test_robots_that_walk_at_random_touch_only_without_the_filter(mode):
    trial = Trial(RandomWalk(), OPEN, 10, (1, 2, 3), (1.2, 1.2), filter_commands=SafetyFilter(mode, FENCE_M))
    nearest_m, farthest_m = np.inf, 0.0
    for _ in range(400):
        trial.step()
        nearest_m = min(nearest_m, measure_distances(trial.poses[..., :2]).min())
        farthest_m = max(farthest_m, np.abs(trial.poses[..., :2]).max())
    assert (nearest_m < 2.0 * BODY_RADIUS_M + 1e-4) == (mode == OFF)
    assert (farthest_m > 0.7 - BODY_RADIUS_M) == (mode == OFF)


def test_far_from_everything_commands_stay_as_they_are():
    poses = np.array([[(0.0, 0.0, 0.5), (3.0, 0.0, 2.0)]])
    linear_m_s, angular_rad_s = np.array([[0.1, 0.05]]), np.array([[0.4, -1.0]])
    found = SafetyFilter(ROBOTS)(poses, linear_m_s, angular_rad_s)
    assert found[0] == pytest.approx(linear_m_s) and found[1] == pytest.approx(angular_rad_s)


def test_a_robot_without_a_fresh_pose_is_stopped_and_ignored():
    poses = np.array([[(0.0, 0.0, 0.0), (0.1, 0.0, math.pi), (np.nan, np.nan, np.nan)]])
    speeds = np.full((1, 3), 0.1)
    linear_m_s, angular_rad_s = SafetyFilter(ROBOTS)(poses, speeds, 0.0 * speeds, np.array([[0.0, 0.9, 0.0]]))
    assert linear_m_s[0, 0] == pytest.approx(0.1)
    assert not linear_m_s[0, 1:].any() and not angular_rad_s[0, 1:].any()


def test_of_the_allowed_velocities_the_nearest_is_found():
    normals = np.array([[(1.0, 0.0), (0.0, 1.0)], [(-1.0, 0.0), (0.0, 1.0)]])
    bounds = np.array([[0.1, -np.inf], [0.0, 0.05]])
    found = nearest_allowed_all(np.array([(0.0, 0.02), (0.1, 0.0)]), normals, bounds, 0.2)
    assert found == pytest.approx(np.array([(0.1, 0.02), (0.0, 0.05)]))
    fast = nearest_allowed_all(np.array([(0.3, 0.4)]), normals[:1], np.array([[-1.0, -1.0]]), 0.2)
    assert fast == pytest.approx(np.array([(0.12, 0.16)]))
