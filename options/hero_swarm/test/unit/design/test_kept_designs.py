"""Methods of design and their candidates: what they find must not change without a word in CHANGELOG.rst.

See hero_test.checks.kept_results.
"""

import io
import sys
import types
from unittest.mock import create_autospec

import numpy as np
import pytest
import yaml

from hero_swarm.design import program
from hero_swarm.design.kinds import Machines, Networks, Numbers
from hero_swarm.design.mission import read_mission
from hero_swarm.design.search import CHOICE, REAL, WHOLE, Genes, adapt, evolve, find_worse, race
from hero_swarm.machines.modules import LIMITS
from hero_test.checks.kept_results import check_sums

GENES = Genes.of([(-2.0, 2.0, REAL), (0, 4, CHOICE), (0.5, 1.0, REAL), (1, 10, WHOLE), (0, 3, CHOICE)])


class Judge:
    """Scores that are the better, the nearer to one candidate, with noise of each seed; keeps what was asked."""

    def __init__(self, noise):
        self.noise, self.asked = noise, []

    def __call__(self, genomes, seeds):
        self.asked += [len(genomes), seeds.start, seeds.stop, genomes]
        noise = np.array([np.random.RandomState(seed).standard_normal(200)[: len(genomes)] for seed in seeds]).T
        off = np.abs(genomes - (0.3, 2.0, 0.8, 7.0, 1.0)) / (GENES.high - GENES.low)
        return -off.sum(axis=1)[:, None] + self.noise * noise


class StubCma:
    """Draws around the best point that it was told of."""

    population_size = 7

    def __init__(self, mean, sigma, bounds, seed):
        self.mean, self.sigma, self.random = mean, sigma, np.random.RandomState(seed)
        assert bounds.tolist() == [[0.0, 1.0]] * len(mean)

    def ask(self):
        return np.clip(self.mean + self.sigma * self.random.standard_normal(len(self.mean)), 0.0, 1.0)

    def tell(self, solutions):
        self.mean = min(solutions, key=lambda solution: solution[1])[0]


@pytest.mark.parametrize(
    ("method", "budget", "kept"),
    [
        (race, 100, [-20.2494768, -8.9754976, 114]),
        (race, 433, [-20.9931809, 0.3360662, 450]),
        (race, 1010, [64.9464556, 30.359843, 1013]),
        (evolve, 1000, [-75.81967, 314.0451642, 1110]),
        (evolve, 3333, [-73.1217504, 170.0179038, 3525]),
        (adapt, 181, [16.4910387, -20.1433526, 225]),
    ],
)
def test_a_method_asks_for_the_candidates_that_it_asked_for(method, budget, kept, monkeypatch):
    monkeypatch.setitem(sys.modules, "cmaes", types.SimpleNamespace(CMA=StubCma))
    judge = Judge(0.05)
    found = method(judge, GENES, budget, np.random.RandomState(4))
    check_sums(kept, found, *judge.asked)


def test_candidates_that_are_worse_are_those_that_were():
    random = np.random.RandomState(3)
    found = []
    for count, seeds in ((2, 5), (3, 5), (4, 10), (9, 5), (12, 20)):
        level = np.linspace(0.0, 1.5, count)[:, None]
        for _ in range(8):
            found.append(find_worse(np.round(level + random.standard_normal((count, seeds)), 1)))
    check_sums([-2.1574742, 0.051301, 240], *found)


MISSION = """\
robots: 2
arena: arena.yaml
time_s: 1
score: order
behavior: segregation
ranges: {own_m: [0.1, 1], near.range_m: [0.5, 2], groups: [2, 6]}
"""
ARENA = "bounds_m: [-1, -1.5, 1.2, 1]\nlamps_m: [[0.9, 0]]\nareas: [{name: spot, circle_m: [0, 0, 0.3], color: 0}]\n"


@pytest.fixture(name="mission")
def write_mission(tmp_path, monkeypatch):
    (tmp_path / "arena.yaml").write_text(ARENA)
    (tmp_path / "m.yaml").write_text(MISSION)
    monkeypatch.chdir(str(tmp_path))
    return "m.yaml"


def draw(genes, seed):
    shares = np.random.RandomState(seed).random_sample((6, len(genes.low)))
    return genes.vary(genes.place(shares), 0.4, np.random.RandomState(seed + 1))


def number_all(content):
    """Return all numbers of a file, in its order, with texts as the sums of their characters."""
    if isinstance(content, dict):
        return number_all([part for item in content.items() for part in item])
    if isinstance(content, list):
        return [number for part in content for number in number_all(part)]
    return [float(sum(map(ord, content)) if isinstance(content, str) else content)]


@pytest.mark.parametrize(
    ("is_tree", "is_bare", "kept"),
    [
        (False, False, [577.252456, 4802.9414402, 725]),
        (False, True, [15795.752948, 1402.6639297, 757]),
        (True, False, [4880.4342777, -780.9916254, 303]),
        (True, True, [7524.8702316, -2408.7438311, 327]),
    ],
)
def test_numbers_of_candidates_become_the_machines_that_they_did(is_tree, is_bare, kept, mission, tmp_path):
    if is_bare:
        (tmp_path / "arena.yaml").write_text(ARENA.partition("\n")[0])
    kind = Machines(read_mission(mission), is_tree)
    files = [yaml.safe_load(kind.dump(genome, "a.yaml", "# mine\n")) for genome in draw(kind.genes, 1)]
    check_sums(kept, *kind.genes, number_all(files))


def test_numbers_of_candidates_become_the_networks_that_they_did(mission):
    kind = Networks(read_mission(mission))
    genomes, found = draw(kind.genes, 2)[:2], [*kind.genes]
    for genome in genomes:
        with np.load(io.BytesIO(kind.dump(genome, "a.yaml", ""))) as file:
            found += [file["w_0"], file["b_0"], number_all(yaml.safe_load(str(file["about"])))]
    (layer,) = kind.make(genomes, None)._file[2]
    check_sums([1140.6507171, -640.08956, 544], *found, *layer)


def test_numbers_of_candidates_become_the_behaviors_that_they_did(mission):
    kind = Numbers(read_mission(mission))
    found = [number_all(yaml.safe_load(kind.dump(genome, "a.yaml", ""))) for genome in draw(kind.genes, 3)]
    check_sums([1671.1063619, -1388.894448, 78], *kind.genes, *found)


def test_numbers_of_modules_are_those_of_chocolate():
    probability, steepness, gain = (0.0, 1.0), (0.0, 20.0), (1.0, 5.0)
    whole = {"turn_steps": (1, 100), "neighbors": (0, 10)}
    assert {"probability": probability, "steepness": steepness, "gain": gain, **whole} == LIMITS


@pytest.mark.parametrize("score", ["order", "dispersion"])
def test_finalists_are_ranked_by_what_is_better_in_pseudo_reality(score, mission, tmp_path, monkeypatch):
    path = tmp_path / mission
    path.write_text(MISSION.replace("score: order", f"score: {score}") + "baseline: dispersion\ndelay_s: 0.1\n")
    results = [np.array([[4.0], [0.0], [-2.0]]), np.array([[4.0, 3.0], [0.5, 0.5], [-2.0, 1.0]])]
    monkeypatch.setattr(program, "_run", create_autospec(program._run, side_effect=results))
    options = program.parse_options([mission, "--tests", "7"])
    title, *rows, best = program.compare(options, read_mission(mission), "m", ["1.npz", "2.npz"]).splitlines()
    told = {"1.npz": ["4", "3.5"], "2.npz": ["0", "0.5"], "dispersion": ["-2", "-0.5"]}
    if score == "order":
        order, first, losses = ["1.npz", "2.npz", "dispersion"], "1.npz", {"1.npz": "12", "dispersion": "-75"}
    else:
        order, first, losses = ["dispersion", "2.npz", "1.npz"], "2.npz", {"1.npz": "-12", "dispersion": "75"}
    assert title.split() == [score, "simulated", "pseudo-reality", "loss", "%"]
    assert [row.split() for row in rows] == [[name, *told[name], losses.get(name, "nan")] for name in order]
    assert best == f"best in pseudo-reality: {first}"
    (stem, content), (other_stem, other) = (call.args[1:] for call in program._run.call_args_list)
    assert (stem, other_stem) == ("m_simulated", "m_pseudo_reality")
    shared = {"robots": 2, "time_s": 1, "seeds": {"count": 7}, "metrics": [score], "arena": "arena.yaml"}
    names = ["1.npz", "2.npz", "dispersion"]
    assert content == {**shared, "delay_s": 0.1, "vary": {"behavior": names}}
    assert other == {**shared, "vary": {"behavior": names, "world": ["usual", "worst"]}}
