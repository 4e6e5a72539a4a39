"""The examples of experiment files: each is read, built, and takes its first step; the missions count what they say."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from hero_sim.world import load_arena
from hero_swarm.behaviors import find_behavior
from hero_swarm.experiments.computing.batch import load_checked
from hero_swarm.experiments.experiment_file import parse_experiment
from hero_swarm.learning.observation import Observation
from hero_swarm.learning.policy import save_policy
from hero_swarm.metrics.own import measure_metric
from hero_swarm.sources import Sources
from hero_swarm.trial import Trial

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"


@pytest.fixture(name="folder")
def copy_examples(tmp_path):
    folder = tmp_path / "examples"
    shutil.copytree(str(EXAMPLES), str(folder), ignore=shutil.ignore_patterns("__pycache__"))
    layers = [(np.full((20, 2), 0.1), np.zeros(2))]
    save_policy(str(folder / "gathering_policy.npz"), layers, Observation((-1.0, -1.0, 1.0, 1.0), neighbors=3))
    return folder


@pytest.mark.parametrize("name", ["exploration", "foraging", "gathering", "learned"])
def test_an_example_is_an_experiment_that_runs(folder, name):
    path = folder / (name + ".yaml")
    experiment = parse_experiment(path.read_text(), str(path))
    load_checked(experiment)
    assert len(experiment.cells) >= 2 and experiment.compare is not None


def run_and_measure(trial, score, seconds):
    """Return the score of a mission, as it is measured each second, at the end."""
    sources = Sources()
    for _ in range(seconds):
        value = measure_metric(f"{EXAMPLES}/missions/scores.py:{score}", trial.state, sources)
        for _ in range(10):
            trial.step()
    return value


@pytest.mark.slow
def test_robots_carry_items_from_sources_to_the_nest():
    forage = find_behavior(str(EXAMPLES / "missions" / "foraging.controller"))
    starts = np.array([[(0.75, 0.0, 0.0), (0.0, -0.9, 0.0), (0.0, 0.5, 0.0)]])
    trial = Trial(forage(), load_arena(forage.arena), robots=3, seeds=[1], starts=starts)
    trial.step()
    assert trial.memory[0].tolist() == [1, 0, 0], "the first one has an item"
    assert run_and_measure(trial, "items", 30)[0] >= 1.0, "the light led it home within 30 s"


@pytest.mark.slow
def test_the_age_of_the_grid_grows_where_no_robot_was():
    explore = find_behavior(str(EXAMPLES / "exploration.py"))
    trial = Trial(explore(linear_m_s=0.0), load_arena("empty"), robots=4, seeds=[1, 2])
    freshness_s = run_and_measure(trial, "freshness_s", 6)
    assert freshness_s.shape == (2,) and (freshness_s < -4.5).all() and (freshness_s >= -5.0).all()
