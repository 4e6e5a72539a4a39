"""Program reproduce: published experiments, run from their files, figure by figure beside what was published.

The files are copied to a folder of the user, where they are ordinary experiments of run; what differs from the
published ones is shown beside the verdict. Published figures and their sources: published/published.yaml.
"""

import argparse
import os
import shutil
from pathlib import Path
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np
import yaml

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
_FIGURES = "published.yaml"

WITHIN, OUTSIDE, NO_FIGURE, NO_RUN = "within", "no", "no published figure", "no run yet"
"""Verdicts."""

QUICK_SEEDS = 2

TOLERANCE = 0.1
"""A published value without a spread is taken to be exact to this share."""


class Figure(NamedTuple):
    """A published figure.

    Attributes:
        name: what it is, for users.
        metric: the column of the results, or a metric over time.
        at_s: when the metric is taken (s); None: the column.
        cells: values that vary, of the cells that the figure is about.
        published: as the source has it, for users.
        low, high: between what a median agrees with it; None: none was published.
    """

    name: str
    metric: str
    at_s: Optional[float]
    cells: Dict[str, Any]
    published: str
    low: Optional[float]
    high: Optional[float]


class Publication(NamedTuple):
    """A published experiment: a sentence, where its figures come from, why ours may differ, and minutes of CPU."""

    name: str
    sentence: str
    source: str
    differs: str
    minutes: float
    figures: Tuple[Figure, ...]

    @property
    def path(self) -> Path:
        """The experiment's file."""
        return SHIPPED / f"{self.name}.yaml"


class Verdict(NamedTuple):
    """Outcome of a figure in one cell: the values of the cell, its runs, and our median; None without a run."""

    figure: Figure
    label: str
    runs: int
    interval: Optional[Interval]

    @property
    def word(self) -> str:
        """Return the verdict: the interval of our median meets what was published, or not."""
        figure, own = self.figure, self.interval
        if own is None:
            return NO_RUN
        if figure.low is None or figure.high is None:
            return NO_FIGURE
        return WITHIN if own.low <= figure.high and own.high >= figure.low else OUTSIDE


def read_publications(path: Path = SHIPPED / _FIGURES) -> List[Publication]:
    """Return all published experiments. Raises: EntryError with the line of what is wrong."""
    keys = ("sentence", "source", "differs", "minutes", "figures")
    publications = []
    for name, entry in load_entries(str(path), "gauci_aggregation: ...").mapping().items():
        given = entry.mapping(keys, keys)
        sentence, source, differs = (given[key].text() for key in keys[:3])
        minutes = given["minutes"].number(0.0, 1e4, "min")
        figures = tuple(map(_parse_figure, given["figures"].entries()))
        publications.append(Publication(name, sentence, source, differs, minutes, figures))
    return publications


def _parse_figure(entry: Entry) -> Figure:
    given = entry.mapping(("name", "metric", "at_s", "cells", "published", "claim"), ("name", "metric", "published"))
    at_s = given["at_s"].number(0.0, 1e6, "s") if "at_s" in given else None
    cells = given["cells"].plain() if "cells" in given else {}
    low, high, shown = None, None, "none"
    if isinstance(given["published"].value, list):
        low, high = given["published"].numbers(2, -np.inf, np.inf, "a number, [low, high] or null")
        shown = f"{low:g} to {high:g}"
    elif given["published"].value is not None:
        value = given["published"].number(-np.inf, np.inf, "")
        low, high = sorted((value * (1.0 - TOLERANCE), value * (1.0 + TOLERANCE)))
        shown = f"{value:g}"
    if "claim" in given:
        shown = f"{given['claim'].text()} ({shown})"
    return Figure(given["name"].text(), given["metric"].text(), at_s, cells, shown, low, high)


def find_publication(name: str) -> Publication:
    """Return the published experiment of this name. Raises: ExperimentError that names those that there are."""
    known = {publication.name: publication for publication in read_publications()}
    if name not in known:
        raise ExperimentError(f"{name!r} is no published experiment; there are {', '.join(known)}")
    return known[name]


def copy_files(folder: str) -> None:
    """Copy the experiments, and what they need, to a folder; files that are there stay as they are."""
    os.makedirs(folder, exist_ok=True)
    for path in SHIPPED.iterdir():
        if path.is_file() and path.name != _FIGURES and not os.path.exists(os.path.join(folder, path.name)):
            shutil.copyfile(str(path), os.path.join(folder, path.name))


def list_changes(publication: Publication, file: str) -> List[str]:
    """Return what differs in the user's file, and in those beside it, from what is published."""
    texts = [Path(path).read_text(encoding="utf-8") for path in (publication.path, file)]
    published, own = (dict(_flatten(yaml.safe_load(text))) for text in texts)
    names = [name for name in {**published, **own} if published.get(name) != own.get(name)]
    changes = [f"{name} {own.get(name, 'left out')} (published: {published.get(name, 'none')})" for name in names]
    for path in sorted(SHIPPED.iterdir()):
        beside = Path(file).parent / path.name
        if path.name in texts[1] and beside.is_file() and beside.read_bytes() != path.read_bytes():
            changes.append(f"{path.name} is another one")
    return changes


def _flatten(value: Any, name: str = "") -> Iterator[Tuple[str, Any]]:
    """Yield the values of a file by names such as seeds.count."""
    if not isinstance(value, dict):
        yield name, value
        return
    for key, inner in value.items():
        yield from _flatten(inner, f"{name}.{key}" if name else str(key))


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
    told = None
    for verdict in verdicts:
        if verdict.figure != told:
            told = verdict.figure
            lines.append(f"  {told.name}: published {told.published}")
        own = "-" if verdict.interval is None else f"{format_interval(verdict.interval)}, {verdict.runs} runs"
        lines.append(f"    {verdict.label:36} {own:40} {verdict.word}")
    lines += [f"  changed: {change}" for change in changes]
    return "\n".join([*lines, f"  may differ: {publication.differs}", f"  source: {publication.source}"])


def reproduce(name: str, options: argparse.Namespace) -> str:
    """Run what is missing of a published experiment, and return the verdicts as text. Raises: ExperimentError."""
    publication = find_publication(name)
    copy_files(options.folder)
    file = os.path.join(options.folder, name + ".yaml")
    try:
        _, experiment = read_experiment(file)
    except ExperimentError as error:
        raise ExperimentError(f"{error}; delete {file} to have the published one again") from error
    given = {**vars(options), "file": file, "out": None, "batch": None, "robots": None}
    runner.run_experiment(argparse.Namespace(**given))
    verdicts = judge(publication, experiment, load(os.path.splitext(file)[0]))
    return describe(publication, verdicts, list_changes(publication, file))


def write_page(path: str, folder: str) -> None:
    """Write the page of all experiments that have runs in folder, and a picture of each beside it."""
    done = []
    for publication in read_publications():
        file = os.path.join(folder, publication.name + ".yaml")
        if os.path.isdir(os.path.splitext(file)[0]):
            results, (_, experiment) = load(os.path.splitext(file)[0]), read_experiment(file)
            verdicts = judge(publication, experiment, results)
            picture = os.path.join("pictures", f"reproduction_{publication.name}.png")
            groups = [int(cell.parameters.get("groups", 1)) for cell in experiment.cells]
            write_file(os.path.join(os.path.dirname(path), picture), draw_picture(results, groups))
            done.append((publication, verdicts, list_changes(publication, file), picture))
    write_file(path, format_page(done).encode())


def parse_options(arguments: Optional[Sequence[str]]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="reproduce", description="Run published experiments and compare figures.")
    add = parser.add_argument
    add("names", nargs="*", metavar="NAME", help="published experiments (list them)")
    add("--folder", default="reproduction", help="of files and results (%(default)s)")
    add("--seeds", type=within(1, MAX_RUNS, int), metavar="N", help="only the first N seeds")
    add("--quick", dest="seeds", action="store_const", const=QUICK_SEEDS, help=f"as --seeds {QUICK_SEEDS}")
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
    elif not options.names:
        for publication in read_publications():
            print(f"{publication.name:24} {publication.sentence} ({publication.minutes:g} min of CPU)")
