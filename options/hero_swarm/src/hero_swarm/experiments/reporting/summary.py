"""Summary of runs: medians with intervals, comparisons, and remarks on both. Pure."""

from typing import Any, Dict, List, Mapping, NamedTuple, Sequence, Tuple

import numpy as np

from ..errors import ExperimentError
from ..experiment_file import Cell, Comparing, Experiment
from ..results_folder import Run, format_csv
from .statistics import (
    CONFIDENCE,
    FEW_SEEDS,
    RESAMPLES,
    Comparison,
    Interval,
    bootstrap_median,
    compare_pairs,
    correct_by_holm,
)


class Summary(NamedTuple):
    """One metric in one cell.

    Attributes:
        values: of all runs that count, in the order of their seeds.
    """

    cell: Cell
    values: Tuple[float, ...]
    interval: Interval


class Report(NamedTuple):
    """Summary of an experiment's runs.

    Attributes:
        summaries: of all cells that have runs, by the name of the metric.
        compared: of each two cells that differ in one value only: the first, the second, and their comparison, of which
            the p-value is corrected for the number of comparisons.
        remarks: what a reader should know before believing it.
        seeds: of the runs that count, sorted.
    """

    experiment: Experiment
    summaries: Dict[str, List[Summary]]
    compared: List[Tuple[Cell, Cell, Comparison]]
    remarks: List[str]
    seeds: List[int]


def build_report(experiment: Experiment, runs: Sequence[Run]) -> Report:
    """Return what runs say. Raises: ExperimentError without a run that counts."""
    counted = [run for run in runs if not run.remark]
    if not counted:
        raise ExperimentError("there is no run to report: compute them with run")
    summaries: Dict[str, List[Summary]] = {metric.name: [] for metric in experiment.metrics}
    for index, own in enumerate(summaries.values()):
        for cell in sorted({run.cell for run in counted}):
            values = tuple(run.values[index] for run in counted if run.cell == cell)
            own.append(Summary(experiment.cells[cell], values, bootstrap_median(values)))
    compared = [] if experiment.compare is None else _compare(experiment, experiment.compare, counted)
    seeds = sorted({run.seed for run in counted})
    return Report(experiment, summaries, compared, _remark(experiment, runs, counted, len(seeds)), seeds)


def _compare(experiment: Experiment, wanted: Comparing, runs: Sequence[Run]) -> List[Tuple[Cell, Cell, Comparison]]:
    """Compare cells that differ in wanted.between only, each with the one of the first value."""
    index = [metric.name for metric in experiment.metrics].index(wanted.metric)
    values: List[Dict[Tuple[int, str], float]] = [{} for _ in experiment.cells]
    for run in runs:
        values[run.cell][run.seed, run.kind] = run.values[index]
    firsts: Dict[str, int] = {}
    pairs = [
        (firsts.setdefault(repr({**cell.varied, wanted.between: None}), index), index)
        for index, cell in enumerate(experiment.cells)
    ]
    compared = []
    for first, second in sorted(pairs):
        shared = sorted(values[first].keys() & values[second].keys())
        if first != second and shared:
            samples = [[values[cell][key] for key in shared] for cell in (first, second)]
            compared.append((experiment.cells[first], experiment.cells[second], compare_pairs(*samples)))
    corrected = correct_by_holm([one.p_value for _, _, one in compared])
    return [(first, second, one._replace(p_value=p)) for (first, second, one), p in zip(compared, corrected)]


def _remark(experiment: Experiment, runs: Sequence[Run], counted: Sequence[Run], seeds: int) -> List[str]:
    remarks = []
    wanted = len(experiment.cells) * len(experiment.seeds)
    if len(runs) < wanted:
        remarks.append("%d of %d runs are still missing" % (wanted - len(runs), wanted))
    if seeds < FEW_SEEDS:
        remarks.append("%d seeds: intervals of fewer than %d are narrower than they claim" % (seeds, FEW_SEEDS))
    if len(counted) < len(runs):
        remarks.append("%d runs are left out: see the column remark" % (len(runs) - len(counted)))
    for index, metric in enumerate(experiment.metrics):
        unreached = sum(np.isinf(run.values[index]) for run in counted)
        if metric.bound is not None and unreached:
            remarks.append("%s: not reached in %d runs, which count as inf" % (metric.name, unreached))
    return remarks


def describe(report: Report) -> str:
    """Return the report as text for a terminal."""
    lines = []
    for metric, summaries in report.summaries.items():
        lines.append(metric)
        for cell, values, interval in summaries:
            lines.append(f"  {cell.label:40} {format_interval(interval)}, {len(values)} runs")
    for comparison in report.compared:
        assert report.experiment.compare is not None
        text = "%s: %s, %s pairs: difference %s, corrected p %s, Cliff's delta %s"
        lines.append(text % (report.experiment.compare.metric, *format_comparison(*comparison)))
    return "\n".join(lines + ["note: " + remark for remark in report.remarks])


def describe_method(report: Report, about: Mapping[str, str]) -> str:
    """Return how the numbers were found, as a sentence for a paper."""
    experiment = report.experiment
    seeds, names = report.seeds, list(experiment.cells[0].varied)
    text = (
        "Each of %d combinations%s was run with the seeds %d to %d, which start alike in all combinations%s; medians"
        " have %.0f %% percentile bootstrap intervals (%d resamples)%s. Computed with HeRo's ROS suite, commit %s, code"
        " %s, Python %s, numpy %s."
    )
    test = "; pairs of the same seed are compared by Wilcoxon's test with Holm's correction and Cliff's delta"
    of_names = f" of {' and '.join(names)}" if names else ""
    same = " with as many robots" if "robots" in names else ""
    values = len(experiment.cells), of_names, seeds[0], seeds[-1], same, 100.0 * CONFIDENCE, RESAMPLES
    versions = (about.get(name, "unknown") for name in ("commit", "code", "python", "numpy"))
    return text % (*values, test if experiment.compare else "", *versions)


def format_interval(interval: Interval) -> str:
    """Return a median with its interval, for users."""
    return "%.4g (%.4g to %.4g)" % interval


def format_comparison(first: Cell, second: Cell, one: Comparison) -> Tuple[str, ...]:
    """Return a comparison as texts: cells, pairs, difference, corrected p-value, and Cliff's delta."""
    cells, difference = f"{second.label} against {first.label}", format_interval(one.difference)
    return cells, str(one.pairs), difference, f"{one.p_value:.2g}", f"{one.delta:+.2f}"


def format_summaries(report: Report) -> str:
    """Return medians and intervals as CSV."""
    names = list(report.experiment.cells[0].varied)
    lines: List[List[Any]] = [[*names, "metric", "runs", "median", "low", "high"]]
    for metric, summaries in report.summaries.items():
        for cell, values, interval in summaries:
            lines.append([*cell.varied.values(), metric, len(values), *map(repr, interval)])
    return format_csv(lines)
