"""Robots as an environment for learning: the same seed gives the same episode, and PettingZoo accepts it."""

import sys
from importlib import import_module
from types import ModuleType

import numpy as np
import pytest

from hero_sim.world.arena import build_rectangle
from hero_swarm.learning.observation import count_observations
from hero_swarm.learning.vector_env import SwarmVectorEnv

ROBOTS = 3


def run(seed, steps, side_m=1.5):
    env = SwarmVectorEnv(1, ROBOTS, build_rectangle(side_m, side_m, ROBOTS))
    random = np.random.RandomState(7)
    observed, rewards = [env.reset(seed)], []
    for _ in range(steps):
        seen, gained = env.step(2.0 * random.random_sample((ROBOTS, 2)) - 1.0)
        observed.append(seen)
        rewards.append(gained)
    return np.array(observed), np.array(rewards)


@pytest.mark.slow
def test_steps_after_the_same_seed_are_equal_and_others_differ():
    first, again, other = run(3, 100), run(3, 100), run(4, 20)
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
    env = SwarmVectorEnv(1, 2, metric="nearest_neighbor")
    env.reset(1)
    start_m = np.hypot(*np.diff(env._rows.world.poses[:, :2], axis=0)[0])
    total = sum(env.step(np.array([(0.5, 0.1), (0.0, 0.0)]))[1] for _ in range(30))
    end_m = np.hypot(*np.diff(env._rows.world.poses[:, :2], axis=0)[0])
    np.testing.assert_allclose(total, end_m - start_m, atol=1e-9)
    assert abs(end_m - start_m) > 0.05


@pytest.mark.option("pettingzoo.test")
def test_pettingzoo_accepts_the_environment():
    from pettingzoo.test import parallel_api_test

    from hero_swarm.learning.parallel_env import SwarmEnv

    env = SwarmEnv(robots=3, time_s=5.0)
    parallel_api_test(env, num_cycles=120)
    first, _ = env.reset(seed=5)
    again, _ = env.reset(seed=5)
    assert list(first) == env.agents == env.possible_agents
    assert all((first[agent] == again[agent]).all() for agent in first)


@pytest.fixture(name="env_class")
def load_env(monkeypatch):
    """SwarmEnv with stand-ins for gymnasium and pettingzoo, which few have installed."""
    for name in ("gymnasium", "gymnasium.spaces", "pettingzoo"):
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    sys.modules["gymnasium.spaces"].Box = lambda low, high, shape, kind: (low, high, shape, kind)
    sys.modules["pettingzoo"].ParallelEnv = object
    monkeypatch.delitem(sys.modules, "hero_swarm.learning.parallel_env", raising=False)
    yield import_module("hero_swarm.learning.parallel_env").SwarmEnv
    sys.modules.pop("hero_swarm.learning.parallel_env", None)


def test_all_agents_live_until_the_time_is_over(env_class):
    env = env_class(robots=2, time_s=0.5, neighbors=1, metric="nearest_neighbor")
    assert env.possible_agents == ["hero_0", "hero_1"] and env.agents == []
    assert env.observation_space("hero_1") == (-1.0, 1.0, (count_observations(1),), np.float32)
    assert env.action_space("hero_0") == (-1.0, 1.0, (2,), np.float32)
    observed, infos = env.reset(seed=5)
    assert list(observed) == env.agents == ["hero_0", "hero_1"] and infos == {"hero_0": {}, "hero_1": {}}
    actions = {"hero_0": np.array((1.0, 0.0)), "hero_1": np.array((0.0, 0.0))}
    for step in range(1, 6):
        observed, rewards, ended, truncated, infos = env.step(actions)
        assert set(observed) == set(rewards) == set(infos) == {"hero_0", "hero_1"}
        assert ended == {"hero_0": False, "hero_1": False}
        assert truncated == {"hero_0": step == 5, "hero_1": step == 5}
    assert env.agents == []
    assert observed["hero_0"][8] > 0.5 > abs(observed["hero_1"][8]), "each agent drives its own robot"


def test_episodes_have_the_given_seed_or_the_one_after_the_last(env_class):
    def start(env, seed=None):
        """Return what agents observe after some steps: robots of another seed have other motors."""
        env.reset(seed)
        for _ in range(5):
            observed = env.step(dict.fromkeys(env.agents, np.array((0.5, 0.2))))[0]
        return np.array(list(observed.values())).tobytes()

    first, second = env_class(robots=2), env_class(robots=2, arena="obstacles")
    assert start(first, 5) == start(first, 5) != start(first) == start(first, 6)
    assert start(env_class(robots=2)) == start(first, 1)
    assert start(second, 5) != start(first, 5), "another arena"
