"""Draws the page of reproduced experiments: a table of verdicts, and where the robots of a run ended. Pure."""

import io
import math
from typing import Any, List, Sequence, Tuple

import numpy as np
from matplotlib.figure import Figure

from ..results import Results
from .figures import COLORS
from .summary import format_interval

_HEAD = """\
# Published experiments, reproduced

Written by `rosrun hero_swarm reproduce --page docs/reproduction.md`. A figure is **within** if our median is in the
published interval, or meets a published value without one to 10 %; **open** if only its 95 % interval does: more seeds
would tell. Intervals of few seeds are wide, those of two or three no more than their range. Worlds `points` and
`discs`: robots as papers have them; [the others](experiments.md#would-it-survive): HeRo.
"""

_MAX_PANELS = 12


def format_page(done: Sequence[Tuple[Any, Sequence[Any], Sequence[str], str]]) -> str:
    """Return the page in Markdown; done: of each experiment the publication, its verdicts, changes and picture."""
    parts: List[str] = [_HEAD]
    for publication, verdicts, changes, picture in done:
        parts.append(f"## {publication.name.replace('_', ' ').capitalize()}\n")
        parts.append(
            f"{publication.sentence}. {publication.source}. {publication.minutes:g} min of CPU with all seeds.\n"
        )
        parts.append(f"![Where the robots of one run of each cell ended]({picture})\n")
        parts.append(
            "| Figure | Robots, world | Published | Ours, median (95 % interval) | Seeds | |\n|---|---|---|---|---|---|"
        )
        for verdict in verdicts:
            own = "" if verdict.interval is None else format_interval(verdict.interval)
            cells = verdict.figure.name, verdict.label, verdict.figure.published, own, str(verdict.runs), verdict.word
            parts.append(f"| {' | '.join(cells)} |")
        parts.append(f"\n{publication.differs}\n")
        parts += [f"Changed by hand: {change}.\n" for change in changes]
    return "\n".join(parts)


def draw_picture(results: Results, groups: Sequence[int]) -> bytes:
    """Return a PNG of where the robots of the first run of each cell were at last; groups: of each cell, for colors."""
    last = [[pose for pose in runs[0] if np.isfinite(pose[0, 0])][-1] for runs in results.read_poses()[:_MAX_PANELS]]
    columns = min(4, len(last))
    rows = math.ceil(len(last) / columns)
    figure = Figure(figsize=(2.2 * columns, 2.4 * rows), constrained_layout=True)
    for index, (poses, label) in enumerate(zip(last, results.labels)):
        axes = figure.add_subplot(rows, columns, index + 1)
        robots = np.isfinite(poses[:, 0])
        colors = [COLORS[group % len(COLORS)] for group in np.arange(len(poses))[robots] % groups[index]]
        axes.scatter(*poses[robots, :2].T, s=6, c=colors)
        axes.set_title(label.replace(", ", "\n", 1), fontsize=7)
        axes.set_aspect("equal", "datalim")
        axes.tick_params(labelsize=6)
    output = io.BytesIO()
    figure.savefig(output, format="png", dpi=80, metadata={"Software": None})
    return output.getvalue()
