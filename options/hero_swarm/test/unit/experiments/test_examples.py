"""The examples of experiment files: each is read, built, and takes its first step; the missions count what they say."""

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from hero_sim.world import load_arena
from hero_swarm.behaviors import find_behavior
from hero_swarm.experiments.computing.batch import load_checked
from hero_swarm.experiments.experiment_file import parse_experiment
from hero_swarm.learning.observation import Observation
from hero_swarm.learning.policy import save_policy
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


def test_robots_carry_items_from_sources_to_the_nest():
    forage = find_behavior(str(EXAMPLES / "foraging.py"))
    starts = np.array([[(0.75, 0.0, 0.0), (0.0, -0.9, 0.0), (0.0, 0.5, 0.0)]])
    trial = Trial(forage(), load_arena(str(EXAMPLES / "foraging_arena.yaml")), robots=3, seeds=[1], starts=starts)
    trial.step()
    carries, items = trial.memory
    assert carries.tolist() == [True, False, False] and items.tolist() == [0.0, 0.0, 0.0]
    for _ in range(300):
        trial.step()
    assert trial.memory[1][0] >= 1.0, "the light led it home within 30 s"
    measure = sys.modules[forage.__module__].items
    assert measure(trial.state).tolist() == [trial.memory[1].sum()]


def test_the_age_of_the_grid_grows_where_no_robot_was():
    explore = find_behavior(str(EXAMPLES / "exploration.py"))
    trial = Trial(explore(linear_m_s=0.0), load_arena("empty"), robots=4, seeds=[1, 2])
    for _ in range(50):
        trial.step()
    visited = trial.state.memory["visits_s"] > 0.0
    assert (visited.sum(axis=(1, 2)) <= 8).all() and visited.any()
    ages_s = sys.modules[explore.__module__].age_s(trial.state)
    assert ages_s.shape == (2,) and (ages_s > 4.5).all() and (ages_s <= 5.0).all()
