"""The report as a self-contained page: no other file, no network."""

import html
from typing import List, Mapping, Sequence, Tuple

import numpy as np

from .figures import draw_over_time, draw_runs, list_labels, to_svg
from .summary import Report, format_interval

OverTime = Tuple[np.ndarray, Mapping[int, np.ndarray]]
"""Times (T,) in s, and cell -> a metric of its runs (T, runs)."""

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #222 }
table { border-collapse: collapse; margin: 1rem 0 }
th, td { padding: .25rem .7rem; text-align: left; border-bottom: 1px solid #ddd }
svg { max-width: 100%; height: auto }
.note { background: #fff4d6; padding: .3rem .7rem; margin: .3rem 0 } pre { background: #f5f5f5; padding: .7rem;
overflow: auto }
"""


def draw_page(
    report: Report,
    units: Mapping[str, str],
    over_time: Mapping[str, OverTime],
    text: str,
    about: Mapping[str, str],
) -> str:
    """Return the page as HTML.

    units: of metrics; over_time: metric -> its course, of those that were recorded; text: the experiment's
    file; about: of
    the folder.
    """
    experiment = report.experiment
    parts = ["<h1>%s</h1>" % html.escape(experiment.behavior)]
    parts += ['<p class="note">%s</p>' % html.escape(remark) for remark in report.remarks]
    parts.append("<p>Each point is a run; large points are medians, with 95 % intervals.</p>")
    for metric in experiment.metrics:
        unit = units.get(metric.source, "")
        parts += _draw_metric(report, metric.name, unit if metric.bound is None else "s")
    if over_time:
        parts.append("<h2>Over time</h2><p>Median of each cell, and the middle half of its runs.</p>")
    for source, (times_s, values) in over_time.items():
        figure = draw_over_time(
            source,
            units.get(source, ""),
            list_labels(experiment, list(values)),
            times_s,
            list(values.values()),
        )
        parts.append(to_svg(figure))
    parts += _list_comparisons(report)
    parts.append("<h2>Experiment</h2><pre>%s</pre>" % html.escape(text))
    rows = [(name, value) for name, value in about.items()]
    parts.append(_table(("", ""), rows))
    title = html.escape(experiment.behavior)
    head = '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>%s</title><style>%s</style></head><body>'
    return head % (title, _STYLE) + "\n".join(parts) + "</body></html>\n"


def _draw_metric(report: Report, metric: str, unit: str) -> List[str]:
    summaries = [summary for summary in report.summaries if summary.metric == metric]
    labels = list_labels(report.experiment, [summary.cell for summary in summaries])
    figure = draw_runs(
        unit,
        labels,
        [summary.values for summary in summaries],
        [summary.interval for summary in summaries],
    )
    rows = [
        (label, str(len(summary.values)), format_interval(summary.interval))
        for label, summary in zip(labels, summaries)
    ]
    heading = "<h2>%s</h2>" % html.escape(metric)
    return [heading, to_svg(figure), _table(("cell", "runs", "median (95 % interval)"), rows)]


def _list_comparisons(report: Report) -> List[str]:
    if report.experiment.compare is None:
        return []
    names = ("cells", "pairs", "difference (95 % interval)", "corrected p", "Cliff's delta")
    rows = [
        (
            "%s against %s" % tuple(list_labels(report.experiment, (compared.second, compared.first))),
            str(compared.comparison.pairs),
            format_interval(compared.comparison.difference),
            "%.2g" % compared.corrected_p,
            "%+.2f" % compared.comparison.delta,
        )
        for compared in report.compared
    ]
    text = "%s: runs of the same seed are paired; Wilcoxon's signed-rank test, corrected by Holm's method"
    return [
        "<h2>Comparison</h2><p>%s</p>" % html.escape(text % report.experiment.compare.metric),
        _table(names, rows),
    ]


def _table(names: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    head = "".join("<th>%s</th>" % html.escape(name) for name in names)
    body = "".join("<tr>%s</tr>" % "".join("<td>%s</td>" % html.escape(cell) for cell in row) for row in rows)
    return "<table><tr>%s</tr>%s</table>" % (head, body)
