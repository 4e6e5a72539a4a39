"""Summary of runs: medians with intervals, comparisons, and remarks on both. Pure."""

from typing import Any, Dict, List, NamedTuple, Sequence, Tuple

import numpy as np

from ..errors import ExperimentError
from ..experiment_file import Experiment, Metric
from ..results_folder import Run, format_csv
from .statistics import FEW_SEEDS, Comparison, Interval, bootstrap_median, compare_pairs, correct_by_holm


class Summary(NamedTuple):
    """One metric in one cell.

    Attributes:
        values: of all runs that count, in the order of their seeds.
    """

    metric: str
    cell: int
    values: Tuple[float, ...]
    interval: Interval


class Compared(NamedTuple):
    """Two cells that differ in one value only.

    Attributes:
        corrected_p: p-value, corrected for the number of comparisons in the report.
    """

    first: int
    second: int
    comparison: Comparison
    corrected_p: float


class Report(NamedTuple):
    """Summary of an experiment's runs.

    Attributes:
        remarks: what a reader should know before believing it.
    """

    experiment: Experiment
    summaries: Tuple[Summary, ...]
    compared: Tuple[Compared, ...]
    remarks: Tuple[str, ...]


def build_report(experiment: Experiment, runs: Sequence[Run]) -> Report:
    """Return what runs say. Raises: ExperimentError without a run that counts."""
    counted = [run for run in runs if not run.remark]
    summaries = [
        _summarize(metric, index, cell, counted)
        for index, metric in enumerate(experiment.metrics)
        for cell in range(len(experiment.cells))
        if any(run.cell == cell for run in counted)
    ]
    if not summaries:
        raise ExperimentError("there is no run to report: compute them with run")
    return Report(
        experiment, tuple(summaries), _compare(experiment, counted), tuple(_remark(experiment, runs))
    )


def _summarize(metric: Metric, index: int, cell: int, runs: Sequence[Run]) -> Summary:
    values = tuple(run.values[index] for run in runs if run.cell == cell)
    return Summary(metric.name, cell, values, bootstrap_median(values))


def _compare(experiment: Experiment, runs: Sequence[Run]) -> Tuple[Compared, ...]:
    """Compare cells that differ in experiment.compare.between only, each with the one of the first value."""
    if experiment.compare is None:
        return ()
    index = [metric.name for metric in experiment.metrics].index(experiment.compare.metric)
    values: Dict[int, Dict[Tuple[int, str], float]] = {}
    for run in runs:
        values.setdefault(run.cell, {})[run.seed, run.kind] = run.values[index]
    pairs: List[Tuple[int, int, Comparison]] = []
    for first, second in _list_pairs(experiment):
        shared = sorted(values.get(first, {}).keys() & values.get(second, {}).keys())
        if shared:
            samples = [[values[cell][key] for key in shared] for cell in (first, second)]
            pairs.append((first, second, compare_pairs(*samples)))
    corrected = correct_by_holm([comparison.p_value for _, _, comparison in pairs])
    return tuple(Compared(*pair, p_value) for pair, p_value in zip(pairs, corrected))


def _list_pairs(experiment: Experiment) -> List[Tuple[int, int]]:
    assert experiment.compare is not None
    name = experiment.compare.between
    groups: Dict[str, List[int]] = {}
    for index, cell in enumerate(experiment.cells):
        others = [item for item in cell.varied.items() if item[0] != name]
        groups.setdefault(repr(others), []).append(index)
    return [(cells[0], cell) for cells in groups.values() for cell in cells[1:]]


def _remark(experiment: Experiment, runs: Sequence[Run]) -> List[str]:
    remarks = []
    wanted = len(experiment.cells) * len(experiment.seeds)
    counted = [run for run in runs if not run.remark]
    if len(runs) < wanted:
        remarks.append("%d of %d runs are still missing" % (wanted - len(runs), wanted))
    if len(experiment.seeds) < FEW_SEEDS:
        remarks.append(
            "%d seeds: intervals of fewer than %d are narrower than they claim"
            % (len(experiment.seeds), FEW_SEEDS)
        )
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
    for metric in report.experiment.metrics:
        lines.append(metric.name)
        for summary in report.summaries:
            if summary.metric == metric.name:
                label = report.experiment.cells[summary.cell].label
                lines.append(
                    "  %-40s %s, %d runs" % (label, format_interval(summary.interval), len(summary.values))
                )
    for compared in report.compared:
        assert report.experiment.compare is not None
        cells = report.experiment.cells
        lines.append(
            "%s: %s against %s: difference %s, corrected p %.2g, Cliff's delta %+.2f"
            % (
                report.experiment.compare.metric,
                cells[compared.second].label,
                cells[compared.first].label,
                format_interval(compared.comparison.difference),
                compared.corrected_p,
                compared.comparison.delta,
            )
        )
    return "\n".join(lines + ["note: " + remark for remark in report.remarks])


def format_interval(interval: Interval) -> str:
    """Return a median with its interval, for users."""
    return "%.4g (%.4g to %.4g)" % interval


def format_summaries(report: Report) -> str:
    """Return medians and intervals as CSV."""
    names = list(report.experiment.cells[0].varied)
    lines: List[List[Any]] = [[*names, "metric", "runs", "median", "low", "high"]]
    for summary in report.summaries:
        varied = report.experiment.cells[summary.cell].varied.values()
        lines.append([*varied, summary.metric, len(summary.values), *map(repr, summary.interval)])
    return format_csv(lines)
