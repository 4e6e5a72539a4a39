"""Draws the metrics of an experiment: every run as a point beside its cell's interval, and medians over time."""

import io
from typing import Any, Dict, Sequence, Tuple

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from ...metrics import UNITS
from ..results import Results
from .statistics import Interval
from .summary import Report, Summary

OVER_TIME, MAP = "_over_time", "_map"
"""Ends of the names of figures."""

_WIDTH_IN = 8.0
_POINT_SPREAD = 0.12
"""Points of a cell are spread over this share of its width, in the order of their seeds."""

# Okabe and Ito's palette (2008) without its yellow, which is hard to see on white.
_COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")


def _choose_style(index: int) -> Dict[str, Any]:
    """Return a color and a line style that no other index has."""
    dash = 2.0 * (index // len(_COLORS))
    return {"color": _COLORS[index % len(_COLORS)], "linestyle": (0, (dash, 1.5)) if dash else "-"}


def draw_all(report: Report, results: Results) -> Dict[str, Figure]:
    """Return all figures by their names: each metric, its map over two numbers that vary, and those over time."""
    figures: Dict[str, Figure] = {}
    for metric in report.experiment.metrics:
        summaries = report.summaries[metric.name]
        label = _label(metric.name, UNITS.get(metric.source, "") if metric.bound is None else "s")
        cells, values, intervals = zip(*summaries)
        figures[metric.name] = draw_runs(label, [cell.label for cell in cells], values, intervals)
        if _spans_a_map(summaries):
            figures[metric.name + MAP] = draw_map(label, summaries)
    for name, series in results.series.items():
        own = {label: runs.T for label, runs in zip(results.labels, series) if not np.isnan(runs).all()}
        if own:
            label = _label(name, UNITS.get(name, ""))
            figures[name + OVER_TIME] = draw_over_time(label, list(own), results.times_s, list(own.values()))
    return figures


def _label(metric: str, unit: str) -> str:
    return f"{metric} ({unit})" if unit else metric


def _spans_a_map(summaries: Sequence[Summary]) -> bool:
    """Return whether two numbers vary, and nothing else, and all their combinations have runs."""
    columns = list(zip(*(summary.cell.varied.values() for summary in summaries)))
    if len(columns) != 2 or not all(isinstance(value, (int, float)) for column in columns for value in column):
        return False
    counts = [len(set(column)) for column in columns]
    return min(counts) > 1 and len(summaries) == counts[0] * counts[1]


def draw_map(metric: str, summaries: Sequence[Summary]) -> Figure:
    """Draw the medians of all combinations of two numbers as colors with their values."""
    figure, axes = _begin(4.5)
    (first, rows), (second, columns) = (
        (name, sorted({summary.cell.varied[name] for summary in summaries})) for name in summaries[0].cell.varied
    )
    medians = np.full((len(rows), len(columns)), np.nan)
    for summary in summaries:
        row, column = rows.index(summary.cell.varied[first]), columns.index(summary.cell.varied[second])
        medians[row, column] = summary.interval.median
    finite = np.where(np.isfinite(medians), medians, np.nan)
    image = axes.imshow(finite, cmap="cividis", origin="lower", aspect="auto")
    middle = np.nanmean([np.nanmin(finite), np.nanmax(finite)]) if np.isfinite(finite).any() else 0.0
    for (row, column), median in np.ndenumerate(medians):
        color = "white" if median < middle else "black"
        axes.text(column, row, "%.3g" % median, ha="center", va="center", color=color, fontsize=8)
    for name, values, axis in ((second, columns, axes.xaxis), (first, rows, axes.yaxis)):
        axis.set_ticks(range(len(values)))
        axis.set_ticklabels(["%g" % value for value in values])
        axis.set_label_text(name)
    figure.colorbar(image, label=f"median {metric}")
    return figure


def _begin(height_in: float) -> Tuple[Figure, Any]:
    figure = Figure(figsize=(_WIDTH_IN, height_in), constrained_layout=True)
    axes = figure.subplots()
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return figure, axes


def draw_runs(
    metric: str, labels: Sequence[str], values: Sequence[Sequence[float]], intervals: Sequence[Interval]
) -> Figure:
    """Draw every run of each cell beside its median and interval; infinite values are counted in words."""
    figure, axes = _begin(1.2 + 0.45 * len(labels))
    for row, (runs, interval) in enumerate(zip(values, intervals)):
        color = _COLORS[row % len(_COLORS)]
        finite = [value for value in runs if np.isfinite(value)]
        places = row + 0.12 + _POINT_SPREAD * np.linspace(0.0, 1.0, len(finite))
        axes.plot(finite, places, ".", color=color, alpha=0.5, markersize=5)
        # What was not reached lies beyond the right end.
        ends = np.minimum(interval, max(finite, default=0.0))
        axes.plot(ends[1:], (row, row), "-|", color=color, markersize=8)
        if np.isfinite(interval.median):
            axes.plot(interval.median, row, "o", color=color)
        if len(finite) < len(runs):
            text = "not reached in %d of %d" % (len(runs) - len(finite), len(runs))
            axes.annotate(
                text, (1.0, row - 0.25), xycoords=("axes fraction", "data"), ha="right", va="center", fontsize=8
            )
    axes.set_yticks(range(len(labels)))
    axes.set_yticklabels(labels, fontsize=8)
    axes.set_ylim(len(labels) - 0.4, -0.6)
    axes.set_xlabel(metric, fontsize=9)
    return figure


def draw_over_time(metric: str, labels: Sequence[str], times_s: np.ndarray, values: Sequence[np.ndarray]) -> Figure:
    """Draw the median and the middle half of each cell's runs, values (T, runs), nan after a run's end."""
    figure, axes = _begin(3.6)
    for index, (label, runs) in enumerate(zip(labels, values)):
        style = _choose_style(index)
        has_runs = ~np.isnan(runs).all(axis=1)
        low, middle, high = np.nanpercentile(runs[has_runs], (25.0, 50.0, 75.0), axis=1)
        axes.plot(times_s[has_runs], middle, label=label, **style)
        axes.fill_between(times_s[has_runs], low, high, color=style["color"], alpha=0.2, linewidth=0.0)
    axes.set_xlabel("time (s)", fontsize=9)
    axes.set_ylabel(metric, fontsize=9)
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    axes.legend(fontsize=8, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))  # beside the lines
    return figure


def to_svg(figure: Figure) -> str:
    """Return a figure as an SVG element for a page."""
    output = io.StringIO()
    with rc_context({"svg.hashsalt": "hero_swarm"}):  # ids are else drawn anew each time
        figure.savefig(output, format="svg", metadata={"Date": None})
    text = output.getvalue()
    return text[text.index("<svg") :]
