"""Learned policies: batched worlds, the file, and the file as a behavior that observes what it learned on."""

import json
from pathlib import Path

import numpy as np
import pytest

from hero_client.values import MAX_LINEAR_M_S
from hero_sim.world import load_arena
from hero_swarm.behavior import Floor, Light, Neighbors, RangeAndBearing
from hero_swarm.behaviors import find_behavior
from hero_swarm.experiments.errors import ExperimentError
from hero_swarm.experiments.runner import parse_options, run_experiment
from hero_swarm.learning.observation import Observation, count_observations
from hero_swarm.learning.policy import load_policy, run_network, save_policy
from hero_swarm.learning.vector_env import SwarmVectorEnv
from hero_swarm.trial import Trial

ARENA = "bounds_m: [-1, -1, 1, 1]\nareas:\n  - {name: nest, rectangle_m: [-1, -1, 1, 0], color: 1}\nlamps_m: [[0, 1]]\n"


@pytest.fixture(name="arena")
def write_arena(tmp_path):
    (tmp_path / "arena.yaml").write_text(ARENA)
    return str(tmp_path / "arena.yaml")


def make_layers(inputs, seed=1):
    random = np.random.RandomState(seed)
    return [
        (random.normal(0, 0.3, (inputs, 6)), random.normal(0, 0.1, 6)),
        (random.normal(0, 0.3, (6, 2)), np.zeros(2)),
    ]


def test_worlds_of_a_batch_are_those_of_single_episodes(arena):
    env = SwarmVectorEnv(worlds=3, robots=2, arena=arena, time_s=0.5, sensors={"floor": Floor()})
    observed = env.reset(seed=7)
    assert observed.shape == (6, count_observations(5) + 4) and not env.ended
    single = SwarmVectorEnv(1, 2, arena, sensors={"floor": Floor()})
    assert (single.reset(8) == observed[2:4]).all()
    actions = np.random.RandomState(1).uniform(-1.0, 1.0, (6, 2))
    for _ in range(5):
        observed, rewards = env.step(actions)
        alone, gained = single.step(actions[2:4])
        assert (alone == observed[2:4]).all() and (gained == rewards[2:4]).all()
    assert env.ended and (env.reset() != observed).any()
    assert (env.reset(seed=7) == SwarmVectorEnv(3, 2, arena, sensors={"floor": Floor()}).reset(seed=7)).all()


def test_sensors_of_behaviors_are_observed_by_the_same_names(arena):
    options = {"neighbors": 1, "sensors": {"lamp": Light(), "floor": Floor()}}
    observed = SwarmVectorEnv(1, 3, arena, **options).reset(1)
    (x_m, y_m), floor, lamp = observed[0, 10:12], observed[0, 16:20], observed[0, 20:]
    assert floor.tolist() == [1.0 if y_m <= 0 else 0.5] * 4
    assert lamp[0] == pytest.approx(1.0 / (1.0 + x_m**2 + (1.0 - y_m) ** 2), rel=1e-5) and len(lamp) == 2


@pytest.mark.slow
def test_a_saved_policy_drives_as_it_did_in_its_environment(arena, tmp_path):
    path = str(tmp_path / "p.npz")
    env = SwarmVectorEnv(1, 3, arena, neighbors=2, range_m=0.7, sensors={"floor": Floor()})
    observed = env.reset(4)
    layers = make_layers(observed.shape[1])
    save_policy(path, layers, env.observation)
    behavior = find_behavior(path)()
    assert behavior.rate_hz == 10.0 and set(behavior.sensors()) == {"near", "eyes", "wheels", "floor"}
    trial = Trial(behavior, load_arena(arena), robots=3, seeds=[4], starts=env._poses.copy())
    for _ in range(30):
        observed, _ = env.step(run_network(layers, observed))
        trial.step()
    np.testing.assert_allclose(trial.poses, env._poses, atol=1e-9)
    assert np.abs(trial.rows.commands[:, 0]).max() <= MAX_LINEAR_M_S


@pytest.mark.slow
def test_an_experiment_takes_a_policy_and_hashes_it(arena, tmp_path):
    observation = Observation((-1.0, -1.0, 1.0, 1.0))
    save_policy(str(tmp_path / "p.npz"), make_layers(24), observation)
    text = "vary: {behavior: [milling, p.npz]}\nrobots: 2\narena: arena.yaml\ntime_s: 1\n"
    text += "seeds: {count: 2}\nmetrics: [dispersion]\n"
    (tmp_path / "e.yaml").write_text(text)
    options = parse_options([str(tmp_path / "e.yaml"), "--jobs", "1"])
    run_experiment(options)
    assert "p.npz" in (tmp_path / "e" / "runs.csv").read_text()
    save_policy(str(tmp_path / "p.npz"), make_layers(24, seed=2), observation)
    with pytest.raises(ExperimentError, match="computed by other code"):
        run_experiment(options)


def write_about(path, about):
    weights, biases = make_layers(24)[0]
    np.savez(path, about=np.array(json.dumps(about)), w_0=weights[:, :2], b_0=biases[:2])


ABOUT = {"version": 1, "rate_hz": 10.0, "bounds_m": [-1, -1, 1, 1], "neighbors": 5, "range_m": 1.0, "sensors": {}}


@pytest.mark.parametrize(
    ("about", "words"),
    [
        ({**ABOUT, "version": 2}, "it has version 2, this suite reads 1: save it again"),
        ({**ABOUT, "sensors": {"x": ["Nose", {}]}}, "Nose"),
        ({**ABOUT, "sensors": {"x": ["Floor", {"deep": 1}]}}, "deep"),
        ({"version": 1}, "sensors"),
        ({"rate_hz": 1.0}, "it has version none, this suite reads 1: save it again; save_policy.. writes such files"),
        ([], "cannot be read"),
    ],
)
def test_a_policy_of_another_version_or_sensor_is_refused(tmp_path, about, words):
    path = str(tmp_path / "p.npz")
    write_about(path, about)
    with pytest.raises(ValueError, match=f"policy .*p.npz cannot be read: .*{words}|policy .*p.npz {words}"):
        find_behavior(path)


@pytest.mark.parametrize("content", [b"", b"text", b"PK\3\4 damaged"])
def test_what_is_no_policy_is_refused(content, tmp_path):
    with pytest.raises(ValueError, match="policy p.npz cannot be read"):
        load_policy("p.npz", content)
    with pytest.raises(ValueError, match="policy .*none.npz: no such file"):
        find_behavior(str(tmp_path / "none.npz"))


def test_layers_that_do_not_fit_are_refused_when_saved_read_and_run(tmp_path):
    path, observation = str(tmp_path / "p.npz"), Observation((-1.0, -1.0, 1.0, 1.0))
    first, last = make_layers(24)
    for layers, words in (
        ([first], "gives 6 numbers"),
        ([last, last], "layer 1 has weights"),
        ([(first[0] * np.nan, first[1]), last], "not finite"),
    ):
        with pytest.raises(ValueError, match=words):
            save_policy(path, layers, observation)
        np.savez(
            path,
            about=json.dumps(ABOUT),
            **{f"{k}_{n}": layer[i] for i, k in enumerate("wb") for n, layer in enumerate(layers)},
        )
        with pytest.raises(ValueError, match=f"p.npz cannot be read: .*{words}"):
            load_policy(path, Path(path).read_bytes())
    with pytest.raises(ValueError, match="sensor x: only built-in sensors"):
        save_policy(path, make_layers(24), observation._replace(sensors={"x": type("Own", (Neighbors,), {})()}))
    save_policy(path, make_layers(23), observation)
    with pytest.raises(ValueError, match="takes 23 numbers, but its sensors give 24: save it again"):
        Trial(find_behavior(path)(), robots=1, size_m=(1.0, 1.0)).step()


def test_messages_of_neighbors_are_observed_flat():
    env = SwarmVectorEnv(worlds=1, robots=2, sensors={"radio": RangeAndBearing()})
    assert env.reset(seed=1).shape[1] == count_observations(5) + 2 * 4, "seen, range, bearing and data of two robots"
