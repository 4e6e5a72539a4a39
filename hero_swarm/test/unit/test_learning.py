"""Robots as an environment for learning: the same seed gives the same episode, and PettingZoo accepts it."""

import numpy as np
import pytest

from hero_sim.world.arena import build_default, build_rectangle
from hero_swarm.learning.episode import Episode, count_observations

ROBOTS = 3


def run(seed, steps, side_m=1.5):
    episode = Episode(ROBOTS, build_rectangle(side_m, side_m, ROBOTS), seed)
    random = np.random.RandomState(7)
    observed, rewards = [episode.observe()], []
    for _ in range(steps):
        rewards.append(episode.step(2.0 * random.random_sample((ROBOTS, 2)) - 1.0))
        observed.append(episode.observe())
    return np.array(observed), np.array(rewards)


@pytest.mark.slow
def test_500_steps_after_the_same_seed_are_equal_and_others_differ():
    first, again, other = run(3, 500), run(3, 500), run(4, 20)
    assert first[0].tobytes() == again[0].tobytes() and first[1].tobytes() == again[1].tobytes()
    assert (first[0][20] != other[0][20]).any(axis=1).all()


def test_observations_are_shares_and_tell_of_walls_speed_and_neighbors():
    observed, _ = run(1, 60, side_m=0.5)
    assert observed.shape == (61, ROBOTS, count_observations(5)) and observed.dtype == np.float32
    assert np.abs(observed).max() <= 1.0 and (observed[..., :8] < 1.0).any()
    assert np.abs(observed[1:, :, 8:10]).max() > 0.3
    np.testing.assert_allclose(np.hypot(*np.moveaxis(observed[..., 12:14], -1, 0)), 1.0, atol=1e-6)
    assert (observed[0, :, 14:18] != 0.0).any() and (observed[..., 18:] == 0.0).all()


def test_rewards_add_up_to_what_the_metric_gained():
    episode = Episode(2, build_default(2), 1, metric="nearest_neighbor")
    start_m = np.hypot(*np.diff(episode._rows.world.poses[:, :2], axis=0)[0])
    total = sum(episode.step(np.array([(0.5, 0.1), (0.0, 0.0)])) for _ in range(30))
    end_m = np.hypot(*np.diff(episode._rows.world.poses[:, :2], axis=0)[0])
    np.testing.assert_allclose(total, end_m - start_m, atol=1e-9)
    assert abs(end_m - start_m) > 0.05


def test_pettingzoo_accepts_the_environment():
    pytest.importorskip("pettingzoo", reason="learning is an option")
    from pettingzoo.test import parallel_api_test

    from hero_swarm.learning.parallel_env import SwarmEnv

    env = SwarmEnv(robots=3, time_s=5.0)
    parallel_api_test(env, num_cycles=120)
    first, _ = env.reset(seed=5)
    again, _ = env.reset(seed=5)
    assert list(first) == env.agents == env.possible_agents
    assert all((first[agent] == again[agent]).all() for agent in first)
