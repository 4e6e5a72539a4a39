"""The report as a self-contained page: no other file, no network."""

import html
from typing import List, Mapping, Sequence

from matplotlib.figure import Figure

from .figures import MAP, OVER_TIME, to_svg
from .summary import Report, describe_method, format_comparison, format_interval

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #222 }
table { border-collapse: collapse; margin: 1rem 0 }
th, td { padding: .25rem .7rem; text-align: left; border-bottom: 1px solid #ddd }
svg { max-width: 100%; height: auto }
.note { background: #fff4d6; padding: .3rem .7rem; margin: .3rem 0 } pre { background: #f5f5f5; padding: .7rem;
overflow: auto }
"""


def draw_page(report: Report, figures: Mapping[str, Figure], text: str, about: Mapping[str, str]) -> str:
    """Return the page as HTML; figures: of draw_all(); text: the experiment's file; about: of the folder."""
    experiment = report.experiment
    parts = [f"<h1>{html.escape(experiment.behavior)}</h1>"]
    parts += [f'<p class="note">{html.escape(remark)}</p>' for remark in report.remarks]
    parts.append("<p>Each point is a run; large points are medians, with 95 % intervals.</p>")
    for name, summaries in report.summaries.items():
        own = [figures[key] for key in (name, name + MAP) if key in figures]
        rows = [(cell.label, str(len(runs)), format_interval(interval)) for cell, runs, interval in summaries]
        parts += [f"<h2>{html.escape(name)}</h2>", *map(to_svg, own)]
        parts.append(_table(("cell", "runs", "median (95 % interval)"), rows))
    over_time = [figure for name, figure in figures.items() if name.endswith(OVER_TIME)]
    if over_time:
        parts.append("<h2>Over time</h2><p>Median of each cell, and the middle half of its runs.</p>")
    parts += map(to_svg, over_time)
    parts += _list_comparisons(report)
    parts.append(f"<h2>Method</h2><p>{html.escape(describe_method(report, about))}</p>")
    parts.append(f"<h2>Experiment</h2><pre>{html.escape(text)}</pre>")
    parts.append(_table(("", ""), list(about.items())))
    title = html.escape(experiment.behavior)
    head = '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>%s</title><style>%s</style></head><body>'
    return head % (title, _STYLE) + "\n".join(parts) + "</body></html>\n"


def _list_comparisons(report: Report) -> List[str]:
    if report.experiment.compare is None:
        return []
    names = ("cells", "pairs", "difference (95 % interval)", "corrected p", "Cliff's delta")
    rows = [format_comparison(*comparison) for comparison in report.compared]
    text = "%s: runs of the same seed are paired; Wilcoxon's signed-rank test, corrected by Holm's method"
    heading = f"<h2>Comparison</h2><p>{html.escape(text % report.experiment.compare.metric)}</p>"
    return [heading, _table(names, rows)]


def _table(names: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    head = "".join(f"<th>{html.escape(name)}</th>" for name in names)
    body = "".join("<tr>%s</tr>" % "".join("<td>%s</td>" % html.escape(cell) for cell in row) for row in rows)
    return f"<table><tr>{head}</tr>{body}</table>"
