"""Methods of design against cases with a known best answer, with their seeds."""

import sys
import types

import numpy as np
import pytest

from hero_node import ProgramError
from hero_sim.world.compiled import COMPILED_ROWS
from hero_swarm.design.search import CHOICE, REAL, RUNS, WHOLE, Genes, adapt, evolve, find_worse, race

BEST = np.array([0.3, -1.0, 2.0])
QUADRATIC = Genes.of([(-2.0, 2.0, REAL), (-5.0, 5.0, REAL), (0.0, 4.0, REAL)])
TWO_STATES = Genes.of([(0, 4, CHOICE), (0, 4, CHOICE), (0.0, 1.0, REAL), (1, 10, WHOLE)])


class Counted:
    """Scores by a function, with noise drawn from each seed, counted."""

    def __init__(self, score, noise=0.0):
        self.score, self.noise, self.runs, self.seeds = score, noise, 0, set()

    def __call__(self, genomes, seeds):
        self.runs += len(genomes) * len(seeds)
        self.seeds.update(seeds)
        drawn = np.array([np.random.RandomState(seed).standard_normal(1000)[: len(genomes)] for seed in seeds]).T
        return np.array([self.score(genome) for genome in genomes])[:, None] + self.noise * drawn


def miss(genome):
    """Minus the distance of a candidate from the best one, as a share of the ranges."""
    return -np.abs((genome - BEST) / (QUADRATIC.high - QUADRATIC.low)).sum()


def solve_two_states(genome):
    """Score of a machine that should search (2) in its first state, rest (4) in the second, and change at once."""
    return float(genome[0] == 2) + float(genome[1] == 4) + genome[2] - abs(genome[3] - 7) / 10.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_racing_finds_the_machine_of_two_states(seed):
    evaluate = Counted(solve_two_states, noise=0.1)
    found = race(evaluate, TWO_STATES, 2000, np.random.RandomState(seed))
    assert found[0, :2].tolist() == [2, 4] and found[0, 2] > 0.6 and abs(found[0, 3] - 7) <= 2
    assert evaluate.runs <= 2000 and len(found) <= 4
    assert (race(Counted(solve_two_states, 0.1), TWO_STATES, 2000, np.random.RandomState(seed)) == found).all()


def test_candidates_drop_out_by_friedmans_test():
    random = np.random.RandomState(5)
    scores = random.standard_normal((6, 10)) * 0.1 + np.array([[3.0], [3.0], [0.0], [1.0], [0.0], [2.98]])
    assert find_worse(scores).tolist() == [False, False, True, True, True, False]
    assert not find_worse(random.standard_normal((6, 10))).any(), "noise alone"
    assert not find_worse(np.ones((4, 5))).any() and not find_worse(scores[:1]).any()


def test_evolution_comes_near_the_best():
    evaluate = Counted(miss)
    found = evolve(evaluate, QUADRATIC, 4000, np.random.RandomState(1))
    assert np.abs(found[0] - BEST).max() < 0.15 and evaluate.runs <= 4000


@pytest.mark.option("cmaes")
def test_cma_finds_the_minimum_of_a_quadratic():
    evaluate = Counted(lambda genome: -(((genome - BEST) / 2.0) ** 2).sum())
    found = adapt(evaluate, QUADRATIC, 2500, np.random.RandomState(1))
    assert np.abs(found[0] - BEST).max() < 0.01 and evaluate.runs <= 2500


class StubCma:
    """Draws around the best point it was told of."""

    population_size = 10

    def __init__(self, mean, sigma, bounds, seed):
        self.mean, self.sigma, self.random = mean, sigma, np.random.RandomState(seed)
        assert bounds.shape == (len(mean), 2)

    def ask(self):
        return np.clip(self.mean + self.sigma * self.random.standard_normal(len(self.mean)), 0.0, 1.0)

    def tell(self, solutions):
        self.mean, self.sigma = min(solutions, key=lambda solution: solution[1])[0], 0.9 * self.sigma


def test_cma_is_asked_and_told_what_is_to_be_small(monkeypatch):
    monkeypatch.setitem(sys.modules, "cmaes", types.SimpleNamespace(CMA=StubCma))
    found = adapt(Counted(miss), QUADRATIC, 2500, np.random.RandomState(1))
    assert np.abs(found[0] - BEST).max() < 0.2
    monkeypatch.setitem(sys.modules, "cmaes", None)
    with pytest.raises(ProgramError, match="apt install python3-cmaes"):
        adapt(Counted(miss), QUADRATIC, 2500, np.random.RandomState(1))


def test_candidates_stay_within_their_limits():
    random = np.random.RandomState(1)
    drawn = TWO_STATES.place(random.random_sample((300, 4)))
    assert (drawn.min(axis=0) >= TWO_STATES.low).all() and (drawn.max(axis=0) <= TWO_STATES.high).all()
    assert set(drawn[:, 0]) == {0, 1, 2, 3, 4} and set(drawn[:, 3]) == set(range(1, 11))
    children = TWO_STATES.vary(drawn, 0.5, random)
    assert (children >= TWO_STATES.low).all() and (children <= TWO_STATES.high).all()
    assert (children[:, 3] == np.rint(children[:, 3])).all()
    changed = (children[:, 0] != drawn[:, 0]).mean()
    assert changed == pytest.approx(0.5 * 0.8, abs=0.1), "half are drawn anew, of five choices"


def test_candidates_of_eight_robots_are_scored_in_compiled_loops():
    """Its candidates are computed one by one, and without compiled loops in four times the time."""
    assert RUNS * 8 >= COMPILED_ROWS
