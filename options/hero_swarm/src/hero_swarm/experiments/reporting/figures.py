"""Draws the metrics of an experiment: every run as a point beside its cell's interval, and medians over time."""

import io
from typing import Any, Sequence, Tuple

import numpy as np
from matplotlib.figure import Figure

from .statistics import Interval

_WIDTH_IN = 8.0
_POINT_SPREAD = 0.12
"""Points of a cell are spread over this share of its width, in the order of their seeds."""

# Okabe and Ito's palette (2008) without its yellow, which is hard to see on white.
_COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")


def _begin(height_in: float) -> Tuple[Figure, Any]:
    figure = Figure(figsize=(_WIDTH_IN, height_in), constrained_layout=True)
    axes = figure.subplots()
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return figure, axes


def draw_runs(
    unit: str,
    labels: Sequence[str],
    values: Sequence[Sequence[float]],
    intervals: Sequence[Interval],
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
    axes.set_xlabel(unit, fontsize=9)
    return figure


def draw_over_time(
    metric: str, unit: str, labels: Sequence[str], times_s: np.ndarray, values: Sequence[np.ndarray]
) -> Figure:
    """Draw the median and the middle half of the runs of each cell.

    values: (T, runs) of each cell, nan after a run's end.
    """
    figure, axes = _begin(3.6)
    for index, (label, runs) in enumerate(zip(labels, values)):
        color = _COLORS[index % len(_COLORS)]
        has_runs = ~np.isnan(runs).all(axis=1)
        low, middle, high = np.nanpercentile(runs[has_runs], (25.0, 50.0, 75.0), axis=1)
        axes.plot(times_s[has_runs], middle, color=color, label=label)
        axes.fill_between(times_s[has_runs], low, high, color=color, alpha=0.2, linewidth=0.0)
    axes.set_xlabel("time (s)", fontsize=9)
    axes.set_ylabel("%s%s" % (metric, " (%s)" % unit if unit else ""), fontsize=9)
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    axes.legend(fontsize=8, frameon=False)
    return figure


def to_svg(figure: Figure) -> str:
    """Return a figure as an SVG element for a page."""
    output = io.StringIO()
    figure.savefig(output, format="svg", metadata={"Date": None})
    text = output.getvalue()
    return text[text.index("<svg") :]
