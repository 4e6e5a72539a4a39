"""Functions of evaluate, genes, a budget in runs and a RandomState that return candidates (C, G), best first. Pure."""

import math
from typing import Any, Callable, NamedTuple, Sequence, Tuple

import numpy as np

from hero_node import import_optional

Evaluate = Callable[[np.ndarray, range], np.ndarray]
"""Scores (C, seeds), larger ones better, of candidates (C, G) with seeds, counted from 0."""

WHOLE, CHOICE, REAL = "whole", "choice", "real"
"""Kinds of genes; choices are whole numbers that have no order."""

RUNS, RACE_RUNS = 5, 200
"""Runs of a candidate before it is compared, as more at once are computed faster, and of a race, at least."""

SIGNIFICANCE, MUTATION, SPREAD = 0.05, 0.05, 0.3


class Genes(NamedTuple):
    """Limits of G numbers, both of which may be taken, and of which kind they are (G,)."""

    low: np.ndarray
    high: np.ndarray
    is_whole: np.ndarray
    is_choice: np.ndarray

    @classmethod
    def of(cls, genes: Sequence[Tuple[float, float, str]]) -> "Genes":
        """Return genes of limits and kinds."""
        low, high, kinds = map(np.array, zip(*genes))
        return cls(low, high, kinds != REAL, kinds == CHOICE)

    def place(self, shares: np.ndarray) -> np.ndarray:
        """Return candidates (C, G) for shares of the ranges, 0 to 1 (C, G)."""
        steps = np.minimum(np.floor(shares * (self.high - self.low + 1.0)), self.high - self.low)
        return self.low + np.where(self.is_whole, steps, shares * (self.high - self.low))

    def vary(self, parents: np.ndarray, spread: float, random: Any) -> np.ndarray:
        """Return children (C, G): choices change with probability spread, numbers by a normal of spread / 2 ranges."""
        moved = parents + random.standard_normal(parents.shape) * spread * (self.high - self.low) / 2.0
        moved = np.clip(np.where(self.is_whole, np.rint(moved), moved), self.low, self.high)
        chance, shares = random.random_sample((2, *parents.shape))
        return np.where(self.is_choice, np.where(chance < spread, self.place(shares), parents), moved)


def race(evaluate: Evaluate, genes: Genes, budget: int, random: Any) -> np.ndarray:
    """Iterated racing: candidates that are worse by a Friedman test drop out, and the best ones have children.

    As irace (M. Lopez-Ibanez et al., Operations Research Perspectives 2016), but each race has seeds of its own.
    """
    size = len(genes.low)
    survivors = 2 + int(math.log2(size))
    races, used, seed, elites = max(1, min(survivors, budget // RACE_RUNS)), 0, 0, np.empty((0, size))
    for number in range(races):
        share = (budget - used) // (races - number) if number else budget // min(races, 2)
        count = max(3 * share // (4 * RUNS) - len(elites), 1)
        children = genes.place(random.random_sample((count, size)))
        if number:  # of two elites drawn, the better one
            parents = elites[random.randint(len(elites), size=(2, count)).min(axis=0)]
            children = genes.vary(parents, SPREAD * (1.0 - number / races), random)
        candidates, enough = np.vstack((elites, children)), survivors if number < races - 1 else 1
        scores, left = np.empty((len(candidates), 0)), share
        while left == share or (len(candidates) > enough and left >= RUNS * len(candidates)):
            scores = np.hstack((scores, evaluate(candidates, range(seed, seed + RUNS))))
            seed, left = seed + RUNS, left - RUNS * len(candidates)
            stays = ~find_worse(scores)
            candidates, scores = candidates[stays], scores[stays]
        used += share - left
        elites = candidates[np.argsort(-scores.mean(axis=1), kind="stable")][:survivors]
    return elites


def find_worse(scores: np.ndarray) -> np.ndarray:
    """Return which candidates (C,) are worse than the best one, by scores with the same seeds (C, seeds).

    Friedman's test, and comparison of ranks: W. J. Conover, Practical Nonparametric Statistics, 1999, 5.8.
    """
    stats = import_optional("scipy.stats", "python3-scipy")
    count, seeds = scores.shape
    with np.errstate(all="ignore"):  # nan where all are equal
        if count < 3 or not stats.friedmanchisquare(*scores)[1] < SIGNIFICANCE:
            return np.zeros(count, dtype=bool)
    ranks = np.apply_along_axis(stats.rankdata, 0, scores)
    sums, freedom = ranks.sum(axis=1), (seeds - 1) * (count - 1)
    spread = math.sqrt(max(0.0, 2.0 * (seeds * (ranks * ranks).sum() - (sums * sums).sum()) / freedom))
    worse: np.ndarray = sums < sums.max() - stats.t.ppf(1.0 - SIGNIFICANCE / 2.0, freedom) * spread
    return worse


def _sort(evaluate: Evaluate, candidates: np.ndarray, generation: int) -> Tuple[np.ndarray, np.ndarray]:
    """Return candidates by their mean scores, best first, and these in the old order."""
    scores = evaluate(candidates, range(generation * RUNS, (generation + 1) * RUNS)).mean(axis=1)
    return candidates[np.argsort(-scores, kind="stable")], scores


def evolve(evaluate: Evaluate, genes: Genes, budget: int, random: Any) -> np.ndarray:
    """Evolution as in EvoStick (G. Francesca et al., Swarm Intelligence 2014): a fifth stays, and has mutants."""
    count = int(np.clip(budget // (20 * RUNS), 10, 100))
    candidates = genes.place(random.random_sample((count, len(genes.low))))
    for generation in range(budget // (count * RUNS)):
        if generation:
            parents = candidates[random.randint(count // 5, size=count - count // 5)]
            candidates = np.vstack((candidates[: count // 5], genes.vary(parents, MUTATION, random)))
        candidates, _ = _sort(evaluate, candidates, generation)
    return candidates


def adapt(evaluate: Evaluate, genes: Genes, budget: int, random: Any) -> np.ndarray:
    """CMA-ES (N. Hansen and A. Ostermeier, Evolutionary Computation 2001). Raises: ProgramError without its library."""
    library, middle = import_optional("cmaes", "python3-cmaes"), np.full(len(genes.low), 0.5)
    limits = np.repeat([[0.0, 1.0]], len(middle), axis=0)
    optimizer = library.CMA(middle, 0.25, bounds=limits, seed=int(random.randint(2**31 - 1)))
    candidates = genes.place(middle[None])
    for generation in range(budget // (optimizer.population_size * RUNS)):
        shares = [optimizer.ask() for _ in range(optimizer.population_size)]
        candidates, scores = _sort(evaluate, genes.place(np.array(shares)), generation)
        optimizer.tell(list(zip(shares, (-scores).tolist())))
    return candidates
