"""Program reproduce: published experiments, run from their files, figure by figure beside what was published.

The files are copied to a folder of the user, where they are ordinary experiments of run; what differs from the
published ones is shown beside the verdict. Published figures and their sources: published/published.yaml.
"""

import argparse
import difflib
import io
import os
import shutil
from pathlib import Path
from typing import Any, Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from hero_node import suggest
from hero_node.files import Entry, load_entries, write_file
from hero_node.parameters import within

from . import runner
from .errors import ExperimentError
from .experiment_file import MAX_RUNS, Experiment, read_experiment
from .reporting.figures import draw_runs
from .reporting.statistics import Interval, bootstrap_median
from .reporting.summary import format_interval
from .results import Results, load

SHIPPED = Path(__file__).resolve().parents[1] / "published"
FIGURES = "published.yaml"
WITHIN, OPEN, OUTSIDE, NO_FIGURE = "within", "open", "no", "no published figure"
"""Verdicts."""

_HEAD = """\
# Published experiments, reproduced

Written by `rosrun hero_swarm reproduce --page docs/reproduction.md`. **within**: our median is in the published
interval, or meets a published value without one to 10 %; **open**: only its 95 % interval does, more seeds would tell.
Those of one to three seeds are their range. In the worlds `points` and `discs` robots are as papers have them."""


class Figure(NamedTuple):
    """A published figure.

    Attributes:
        metric: the column of the results, or a metric over time.
        at_s: when the metric is taken (s); None: it is a column.
        cells: values that vary, of the cells that the figure is about.
        published: as the source has it.
        bounds: between what a median agrees with it; None: none was published.
    """

    name: str
    metric: str
    at_s: Optional[float]
    cells: Dict[str, Any]
    published: str
    bounds: Optional[Tuple[float, float]]


class Publication(NamedTuple):
    """A published experiment: what it shows, where its figures come from, why ours may differ, minutes of CPU."""

    sentence: str
    source: str
    differs: str
    minutes: float
    figures: Tuple[Figure, ...]


class Verdict(NamedTuple):
    """Outcome of a figure in one cell: the values of the cell, its runs, and our median."""

    figure: Figure
    label: str
    runs: int
    interval: Interval

    @property
    def word(self) -> str:
        """The verdict: our median is within what was published, or its interval misses it; else it is open."""
        if self.figure.bounds is None:
            return NO_FIGURE
        (low, high), own = self.figure.bounds, self.interval
        if low <= own.median <= high:
            return WITHIN
        return OPEN if own.low <= high and own.high >= low else OUTSIDE


def read_publications() -> Dict[str, Publication]:
    """Return all published experiments by name. Raises: EntryError with the line of what is wrong."""
    publications = {}
    for name, entry in load_entries(str(SHIPPED / FIGURES), "gauci_aggregation: ...").mapping().items():
        given = entry.mapping(Publication._fields, Publication._fields)
        texts = {key: given[key].text() for key in ("sentence", "source", "differs")}
        figures = tuple(map(_parse_figure, given["figures"].entries()))
        publications[name] = Publication(minutes=given["minutes"].number(0.0, 1e4, "min"), figures=figures, **texts)
    return publications


def _parse_figure(entry: Entry) -> Figure:
    given = entry.mapping(Figure._fields[:-1], ("name", "metric", "published"))
    at_s = given["at_s"].number(0.0, 1e6, "s") if "at_s" in given else None
    cells, published, bounds = given.get("cells"), given["published"], None
    if isinstance(published.value, list):
        low, high = published.numbers(2, -np.inf, np.inf, "a number, [low, high] or null")
        bounds = low, high
    elif published.value is not None:
        value = published.number(-np.inf, np.inf, "")
        bounds = value - 0.1 * abs(value), value + 0.1 * abs(value)
    shown = "none" if bounds is None else str(published.plain())
    return Figure(given["name"].text(), given["metric"].text(), at_s, cells.plain() if cells else {}, shown, bounds)


def copy_files(folder: str) -> None:
    """Copy the experiments, and what they need, to a folder; files that are there stay as they are."""
    os.makedirs(folder, exist_ok=True)
    for path in SHIPPED.iterdir():
        own = Path(folder) / path.name
        if path.is_file() and path.name != FIGURES and not own.exists():
            shutil.copyfile(str(path), str(own))


def list_changes(file: str) -> List[str]:
    """Return the lines in which the user's file, and those beside it that it names, differ from what is published."""
    changes, shipped = [], SHIPPED / os.path.basename(file)
    for path in sorted(SHIPPED.iterdir()):
        own = Path(file).parent / path.name
        if own.is_file() and (path == shipped or path.name in shipped.read_text()):
            lines = difflib.ndiff(path.read_text().splitlines(), own.read_text(errors="replace").splitlines())
            changes += [f"{path.name}: {line}" for line in lines if line[0] in "-+"]
    return changes


def judge(publication: Publication, experiment: Experiment, results: Results) -> List[Verdict]:
    """Return the verdict on each figure in each of its cells that has runs."""
    verdicts = []
    for figure in publication.figures:
        for cell in results.find(**figure.cells):
            if figure.at_s is None:
                values = results.metrics[figure.metric][cell]
            else:
                values = results.series[figure.metric][cell][:, round(figure.at_s)]
            done = values[~np.isnan(values)].tolist()
            settings = {"robots": experiment.cells[cell].settings["robots"], **results.cells[cell]}
            label = ", ".join(f"{key} {value}" for key, value in settings.items())
            verdicts += [Verdict(figure, label, len(done), bootstrap_median(done))] if done else []
    return verdicts


def describe(publication: Publication, verdicts: Sequence[Verdict], changes: Sequence[str]) -> str:
    """Return the verdicts as a table of Markdown, which a terminal shows, too, with what else a reader should know."""
    rows = [("figure", "cell", "published", "ours, median (95 % interval)", "runs", "verdict")]
    for verdict in verdicts:
        figure, own = verdict.figure, format_interval(verdict.interval)
        rows.append((figure.name, verdict.label, figure.published, own, str(verdict.runs), verdict.word))
    widths = [max(map(len, column)) for column in zip(*rows)]
    lines = [f"| {' | '.join(map(str.ljust, row, widths))} |" for row in rows]
    lines.insert(1, f"|{'|'.join('-' * (width + 2) for width in widths)}|")
    texts = [f"{publication.sentence}. Published: {publication.source}.", f"May differ: {publication.differs}."]
    return "\n\n".join([texts[0], "\n".join(lines), texts[1], *(f"Changed: `{change}`" for change in changes)])


def reproduce(name: str, options: argparse.Namespace) -> str:
    """Run what is missing of a published experiment, and return the verdicts as text. Raises: ExperimentError."""
    publications = read_publications()
    if name not in publications:
        text = "%r is no published experiment; there are %s%s"
        raise ExperimentError(text % (name, ", ".join(publications), suggest(name, publications)))
    copy_files(options.folder)
    file = os.path.join(options.folder, name + ".yaml")
    try:
        _, experiment = read_experiment(file)
    except ExperimentError as error:
        raise ExperimentError(f"{error}; delete {file} to have the published one again") from error
    runner.run_experiment(argparse.Namespace(**vars(options), file=file))
    verdicts = judge(publications[name], experiment, load(os.path.splitext(file)[0]))
    return describe(publications[name], verdicts, list_changes(file))


def write_page(path: str, folder: str) -> None:
    """Write the page of all experiments with runs in folder, and beside it a picture of each by its first metric."""
    parts = [_HEAD]
    os.makedirs(os.path.join(os.path.dirname(path), "pictures"), exist_ok=True)
    for name, publication in read_publications().items():
        stem = os.path.join(folder, name)
        if not os.path.isdir(stem):
            continue
        results, (_, experiment) = load(stem), read_experiment(stem + ".yaml")
        values = [own[~np.isnan(own)].tolist() for own in results.metrics[experiment.metrics[0].name]]
        drawn = [(label, runs, bootstrap_median(runs)) for label, runs in zip(results.labels, values) if runs]
        if drawn:
            content, picture = io.BytesIO(), f"pictures/reproduction_{name}.png"
            draw_runs(experiment.metrics[0].name, *zip(*drawn)).savefig(content, format="png", dpi=70)
            write_file(os.path.join(os.path.dirname(path), picture), content.getvalue())
            text = describe(publication, judge(publication, experiment, results), list_changes(stem + ".yaml"))
            parts += [f"## {name.replace('_', ' ').capitalize()}", text, f"![Every run of each cell]({picture})"]
    write_file(path, "\n\n".join([*parts, ""]).encode())


def main(arguments: Optional[Sequence[str]] = None) -> None:
    """Run the program."""
    parser = argparse.ArgumentParser(prog="reproduce", description="Run published experiments and compare figures.")
    add = parser.add_argument
    add("names", nargs="*", metavar="NAME", help="published experiments (list them)")
    add("--folder", default="reproduction", help="of files and results (%(default)s)")
    add("--seeds", type=within(1, MAX_RUNS, int), metavar="N", help="only the first N seeds")
    add("--quick", dest="seeds", action="store_const", const=2, help="as --seeds 2")
    runner.add_engine_options(parser)
    add("--fresh", action="store_true", help="delete earlier runs of these experiments")
    add("--page", metavar="FILE.md", help="write a page and pictures of what was run")
    parser.set_defaults(out=None, batch=None, robots=None)
    options = parser.parse_args(arguments)
    for name in options.names:
        print(reproduce(name, options))
    if options.page:
        write_page(options.page, options.folder)
        print(options.page)
    for name, one in read_publications().items() if not options.names and not options.page else ():
        print(f"{name:24} {one.sentence} ({one.minutes:g} min of CPU)")
