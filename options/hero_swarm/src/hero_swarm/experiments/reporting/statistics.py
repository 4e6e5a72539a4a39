"""Intervals and tests for the runs of an experiment. Pure: numpy, and scipy for the signed-rank test only.

Medians have percentile bootstrap intervals (Efron 1979): bias-corrected intervals are undefined where most values are
equal, which metrics that are bounded often are. Paired differences are tested by Wilcoxon's signed-rank test (1945),
their size is Cliff's delta (1993), and several comparisons are corrected by Holm's step-down method (1979).
"""

from typing import List, NamedTuple, Sequence, Tuple

import numpy as np

from hero_node import import_optional

from ..errors import ExperimentError

RESAMPLES = 9999
"""Odd, and one less than a round number, so that both bounds of the interval are resampled values."""

CONFIDENCE = 0.95

FEW_SEEDS = 30
"""Below this number of values the interval of a median is narrower than it claims."""

_SEED = 20261123
"""The resampling is the same for each report of the same runs."""

_BLOCK_VALUES = 2_000_000
"""Values that are resampled at once, which bounds the memory; more than an experiment may have (MAX_RUNS)."""


class Interval(NamedTuple):
    """The median of some values, and the bounds of its confidence interval."""

    median: float
    low: float
    high: float


class Comparison(NamedTuple):
    """Values of two cells, paired by their seeds.

    Attributes:
        pairs: how many.
        difference: of each pair, second minus first: median and interval.
        p_value: of the signed-rank test, two-sided; 1 if all pairs are equal.
        delta: Cliff's delta, -1 to 1: how much more often a value of the second is larger than one of the first.
    """

    pairs: int
    difference: Interval
    p_value: float
    delta: float


def bootstrap_median(values: Sequence[float]) -> Interval:
    """Return the median of values, all finite or inf, with its interval of CONFIDENCE.

    Raises: ExperimentError without a value, or for nan.
    """
    sample = np.sort(np.asarray(values, dtype=float))
    if not len(sample) or np.isnan(sample).any():
        raise ExperimentError(f"no median of {len(sample)} values{', one of which is nan' if len(sample) else ''}")
    rng = np.random.RandomState(_SEED)
    block = _BLOCK_VALUES // len(sample)
    medians: List[np.ndarray] = []
    for start in range(0, RESAMPLES, block):
        chosen = rng.randint(len(sample), size=(min(block, RESAMPLES - start), len(sample)))
        medians.append(np.median(sample[chosen], axis=1))
    resampled = np.sort(np.concatenate(medians))
    tail = (RESAMPLES + 1) * (1.0 - CONFIDENCE) / 2.0
    low, high = round(tail) - 1, RESAMPLES - round(tail)
    return Interval(float(np.median(sample)), float(resampled[low]), float(resampled[high]))


def cliffs_delta(first: Sequence[float], second: Sequence[float]) -> float:
    """Return how much more often a value of second is larger than one of first than smaller, -1 to 1."""
    ours, theirs = np.sort(np.asarray(first, dtype=float)), np.asarray(second, dtype=float)
    larger = np.searchsorted(ours, theirs, side="left").sum()  # values of first below each of second
    smaller = (len(ours) - np.searchsorted(ours, theirs, side="right")).sum()
    return float(larger - smaller) / (len(ours) * len(theirs))


def compare_pairs(first: Sequence[float], second: Sequence[float]) -> Comparison:
    """Compare values of the same seeds, in the same order.

    Raises: ExperimentError for a value that is not finite. ProgramError without scipy.
    """
    ours, theirs = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    differences = theirs - ours
    if not np.isfinite(differences).all():
        raise ExperimentError("a value that is not finite cannot be compared: compare another metric, or longer runs")
    unequal, p_value = differences[differences != 0.0], 1.0
    if len(unequal):
        p_value = float(import_optional("scipy.stats", "python3-scipy").wilcoxon(unequal).pvalue)
    delta = cliffs_delta(ours.tolist(), theirs.tolist())
    return Comparison(len(differences), bootstrap_median(differences), p_value, delta)


def correct_by_holm(p_values: Sequence[float]) -> Tuple[float, ...]:
    """Return the p-values (in their order) of several tests of one question, corrected for their number."""
    ordered, order = np.sort(p_values), np.argsort(p_values, kind="stable")
    factors, corrected = len(ordered) - np.arange(len(ordered)), np.empty(len(ordered))
    corrected[order] = np.maximum.accumulate(np.minimum(1.0, factors * ordered))
    return tuple(corrected.tolist())
