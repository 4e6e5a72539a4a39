"""Program reproduce: published experiments, run from their files, figure by figure beside what was published.

The files are copied to a folder of the user, where they are ordinary experiments of run; what differs from the
published ones is shown beside the verdict. Published figures and their sources: published/published.yaml.
"""

import argparse
import difflib
import os
import shutil
from pathlib import Path
from typing import Any, Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from hero_node.files import Entry, load_entries, write_file
from hero_node.parameters import within

from . import runner
from .computing.code_version import PUBLISHED
from .errors import ExperimentError
from .experiment_file import MAX_RUNS, Experiment, read_experiment
from .reporting.reproduction_page import draw_picture, format_page
from .reporting.statistics import Interval, bootstrap_median
from .reporting.summary import format_interval
from .results import Results, load

SHIPPED = Path(__file__).resolve().parents[1] / PUBLISHED
FIGURES = "published.yaml"

WITHIN, OPEN, OUTSIDE, NO_FIGURE, NO_RUN = "within", "open", "no", "no published figure", "no run yet"
"""Verdicts."""

TOLERANCE = 0.1
"""A published value without a spread is taken to be exact to this share."""


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

    name: str
    sentence: str
    source: str
    differs: str
    minutes: float
    figures: Tuple[Figure, ...]


class Verdict(NamedTuple):
    """Outcome of a figure in one cell: the values of the cell, its runs, and our median; None without a run."""

    figure: Figure
    label: str
    runs: int
    interval: Optional[Interval]

    @property
    def word(self) -> str:
        """The verdict: our median is within what was published, or its interval misses it; else it is open."""
        if self.interval is None or self.figure.bounds is None:
            return NO_RUN if self.interval is None else NO_FIGURE
        low, high = self.figure.bounds
        if low <= self.interval.median <= high:
            return WITHIN
        return OPEN if self.interval.low <= high and self.interval.high >= low else OUTSIDE


def read_publications() -> Dict[str, Publication]:
    """Return all published experiments by name. Raises: EntryError with the line of what is wrong."""
    publications = {}
    for name, entry in load_entries(str(SHIPPED / FIGURES), "gauci_aggregation: ...").mapping().items():
        given = entry.mapping(Publication._fields[1:], Publication._fields[1:])
        sentence, source, differs = (given[key].text() for key in ("sentence", "source", "differs"))
        figures = tuple(map(_parse_figure, given["figures"].entries()))
        minutes = given["minutes"].number(0.0, 1e4, "min")
        publications[name] = Publication(name, sentence, source, differs, minutes, figures)
    return publications


def _parse_figure(entry: Entry) -> Figure:
    given = entry.mapping(Figure._fields[:-1], ("name", "metric", "published"))
    at_s = given["at_s"].number(0.0, 1e6, "s") if "at_s" in given else None
    cells, published, bounds, shown = given.get("cells"), given["published"], None, "none"
    if isinstance(published.value, list):
        low, high = published.numbers(2, -np.inf, np.inf, "a number, [low, high] or null")
        bounds, shown = (low, high), f"{low:g} to {high:g}"
    elif published.value is not None:
        value = published.number(-np.inf, np.inf, "")
        bounds, shown = (value - TOLERANCE * abs(value), value + TOLERANCE * abs(value)), f"{value:g}"
    return Figure(given["name"].text(), given["metric"].text(), at_s, cells.plain() if cells else {}, shown, bounds)


def copy_files(folder: str) -> None:
    """Copy the experiments, and what they need, to a folder; files that are there stay as they are."""
    os.makedirs(folder, exist_ok=True)
    for path in SHIPPED.iterdir():
        if path.is_file() and path.name != FIGURES and not os.path.exists(os.path.join(folder, path.name)):
            shutil.copyfile(str(path), os.path.join(folder, path.name))


def list_changes(file: str) -> List[str]:
    """Return the lines of the user's file, and of those beside it that it names, that differ from what is published."""
    changes, shipped = [], SHIPPED / os.path.basename(file)
    for path in sorted(SHIPPED.iterdir()):
        own = Path(file).parent / path.name
        if own.is_file() and (path == shipped or path.name in shipped.read_text()):
            lines = difflib.ndiff(path.read_text().splitlines(), own.read_text(errors="replace").splitlines())
            changes += [f"{path.name}: {line}" for line in lines if line[0] in "-+"]
    return changes


def judge(publication: Publication, experiment: Experiment, results: Results) -> List[Verdict]:
    """Return the verdict on each figure in each of its cells."""
    verdicts = []
    for figure in publication.figures:
        for cell in results.find(**figure.cells):
            if figure.at_s is None:
                values = results.metrics[figure.metric][cell]
            else:
                values = results.series[figure.metric][cell][:, round(figure.at_s)]
            values = values[~np.isnan(values)]  # of runs that are missing
            interval = bootstrap_median(values.tolist()) if len(values) else None
            settings = {"robots": experiment.cells[cell].settings["robots"], **results.cells[cell]}
            label = ", ".join(f"{key} {value}" for key, value in settings.items())
            verdicts.append(Verdict(figure, label, len(values), interval))
    return verdicts


def describe(publication: Publication, verdicts: Sequence[Verdict], changes: Sequence[str]) -> str:
    """Return the verdicts as text for a terminal."""
    lines = [f"{publication.name}: {publication.sentence}"]
    for figure, label, runs, interval in verdicts:
        told = f"  {figure.name}: published {figure.published}"
        lines += [told] if told not in lines else []
        own = "-" if interval is None else f"{format_interval(interval)}, {runs} runs"
        lines.append(f"    {label:36} {own:40} {Verdict(figure, label, runs, interval).word}")
    lines += [f"  changed: {change}" for change in changes]
    return "\n".join([*lines, f"  may differ: {publication.differs}", f"  source: {publication.source}"])


def reproduce(name: str, options: argparse.Namespace) -> str:
    """Run what is missing of a published experiment, and return the verdicts as text. Raises: ExperimentError."""
    publications = read_publications()
    if name not in publications:
        raise ExperimentError(f"{name!r} is no published experiment; there are {', '.join(publications)}")
    copy_files(options.folder)
    file = os.path.join(options.folder, name + ".yaml")
    try:
        _, experiment = read_experiment(file)
    except ExperimentError as error:
        raise ExperimentError(f"{error}; delete {file} to have the published one again") from error
    runner.run_experiment(
        argparse.Namespace(**{**vars(options), "file": file, "out": None, "batch": None}, robots=None)
    )
    verdicts = judge(publications[name], experiment, load(os.path.splitext(file)[0]))
    return describe(publications[name], verdicts, list_changes(file))


def write_page(path: str, folder: str) -> None:
    """Write the page of all experiments that have runs in folder, and a picture of each beside it."""
    done = []
    for name, publication in read_publications().items():
        file = os.path.join(folder, name + ".yaml")
        if os.path.isdir(os.path.join(folder, name)):
            results, (_, experiment) = load(os.path.join(folder, name)), read_experiment(file)
            picture = os.path.join("pictures", f"reproduction_{name}.png")
            groups = [int(cell.parameters.get("groups", 1)) for cell in experiment.cells]
            write_file(os.path.join(os.path.dirname(path), picture), draw_picture(results, groups))
            done.append((publication, judge(publication, experiment, results), list_changes(file), picture))
    write_file(path, format_page(done).encode())


def parse_options(arguments: Optional[Sequence[str]]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="reproduce", description="Run published experiments and compare figures.")
    add = parser.add_argument
    add("names", nargs="*", metavar="NAME", help="published experiments (list them)")
    add("--folder", default="reproduction", help="of files and results (%(default)s)")
    add("--seeds", type=within(1, MAX_RUNS, int), metavar="N", help="only the first N seeds")
    add("--quick", dest="seeds", action="store_const", const=2, help="as --seeds 2")
    runner.add_engine_options(parser)
    add("--fresh", action="store_true", help="delete earlier runs of these experiments")
    add("--page", metavar="FILE.md", help="write a page and pictures of what was run")
    return parser.parse_args(arguments)


def main(arguments: Optional[Sequence[str]] = None) -> None:
    """Run the program."""
    options = parse_options(arguments)
    for name in options.names:
        print(reproduce(name, options))
    if options.page:
        write_page(options.page, options.folder)
        print(options.page)
    for one in read_publications().values() if not options.names and not options.page else ():
        print(f"{one.name:24} {one.sentence} ({one.minutes:g} min of CPU)")
