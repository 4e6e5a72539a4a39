"""The folder of an experiment's results: nothing in it is half-written, stale or counted twice.

    experiment.yaml    the file, as it was when the experiment began
    about.json         versions, commit, machine
    batches/*.jsonl    the runs of each finished batch, named by the digest of its cell, its seeds and the code
    series/*.npy       metrics over time of each batch, and poses if they are recorded
    set_aside/N/       batches that --fresh does not delete: damaged ones, and trials on robots
    *.lock             held while a program adds runs of this kind
    runs.csv           all runs, sorted; the same bytes however they were computed
    series.csv         where the series of each run are: files, and the place of the run in them

A batch is written to a temporary file, which is renamed when the disk has it; no two writers' files have one name.
A folder is ours by its about.json; of others nothing is written, and in ours no file of another name is touched.
Knows neither processes nor robots.
"""

import csv
import hashlib
import io
import itertools
import json
import math
import os
import re
from contextlib import ExitStack, contextmanager, suppress
from typing import Any, Callable, Dict, Iterable, Iterator, List, NamedTuple, Sequence, Set, Tuple

import numpy as np

from hero_node import one_line
from hero_node.files import hold_file, read_file, write_file

from .errors import ExperimentError
from .experiment_file import Experiment, read_experiment

SIMULATED = "simulated"
"""Kind of a run that was computed."""

REAL = "real"
"""Kind of a run on robots."""

OTHER_CELL = -1
"""Cell of a run of another experiment."""

METRICS_ENDING, POSES_ENDING = ".metrics.npy", ".poses.npy"
"""Files of a batch: samples (T, W, metrics) of the metrics of list_sources(), and poses (T, W, N, 3); nan
after a run's end."""

ABOUT, EXPERIMENT, LOCK_ENDING = "about.json", "experiment.yaml", ".lock"

FOLDER = "experiment_folder"
"""Key in about.json: folder of the experiment's file, base of its paths, relative to the results folder."""

_BATCH_NAME = re.compile(r"[0-9a-f]{24}\.jsonl")
_SERIES_NAME = re.compile(r"[0-9a-f]{24}\.(metrics|poses)\.npy(\.part|\.[0-9a-f]{8}\.new)?")

RunKey = Tuple[int, int]
"""Index of the cell, and seed."""


class Run(NamedTuple):
    """Results of one run.

    Attributes:
        cell: index of the cell.
        values: of the metrics, in the order of the experiment; inf: a bound was not reached.
        kind: SIMULATED or REAL.
        remark: why a run on robots does not count; empty: it does.
    """

    cell: int
    seed: int
    values: Tuple[float, ...]
    kind: str = SIMULATED
    remark: str = ""


class ResultsFolder:
    """The results of one experiment."""

    def __init__(self, path: str, experiment: Experiment, code: str) -> None:
        """Use the folder path; code: digest of what computes the runs. Nothing is read or written yet."""
        self.path = path
        self._experiment = experiment
        self._code = code
        self._cells: List[str] = []
        for cell in experiment.cells:
            digest = hashlib.sha256(experiment.describe_cell(cell).encode())
            for file in experiment.list_files(cell).values():
                digest.update(experiment.sources.read(file))
            self._cells.append(digest.hexdigest())
        self._indices = {digest: index for index, digest in enumerate(self._cells)}
        self._batches, self._series = os.path.join(path, "batches"), os.path.join(path, "series")

    @contextmanager
    def hold(self, kind: str = SIMULATED, is_shared: bool = False) -> Iterator[None]:
        """Keep other programs from adding runs of this kind, unless they share the folder as this one does.

        The folder is made if it is missing. Raises: ExperimentError if it is not ours, or another program holds it.
        """
        self._make()
        with ExitStack() as stack:
            try:
                is_held = stack.enter_context(hold_file(os.path.join(self.path, kind + LOCK_ENDING), is_shared))
            except BlockingIOError:
                text = "%s: another run is adding to it; wait for its end, or share the work: --part 1/2 and --part 2/2"
                raise ExperimentError(text % self.path) from None
            if is_held and not is_shared and kind == SIMULATED:
                self._remove_series(lambda name: not name.endswith(".npy"))  # left behind by a killed program
            yield

    def begin(self, text: str, about: Dict[str, str]) -> List[Run]:
        """Begin, or continue, and return the runs that the folder holds already; text: of the experiment's file.

        Raises: ExperimentError if it holds runs of another experiment or of other code, or something else.
        """
        self._make()
        has_begun = os.path.exists(os.path.join(self.path, ABOUT))
        if not has_begun:
            self._write_about(about)
        for folder in (self._batches, self._series):
            os.makedirs(folder, exist_ok=True)
        runs = self.read_runs()
        write_file(os.path.join(self.path, EXPERIMENT), text.encode())
        if has_begun and not any(run.kind == SIMULATED for run in runs):
            self._write_about(about)
        return runs

    def _make(self) -> None:
        """Make the folder, unless it is there and ours. Raises: ExperimentError."""
        if "\0" in self.path:
            raise ExperimentError(f"--out {self.path!r}: a name cannot hold a NUL character")
        names = _list_names(self.path)
        # A program that was killed while it began has left these.
        begun = [name for name in names if name.endswith(LOCK_ENDING) or name.startswith(ABOUT)]
        if ABOUT in names:
            read_about(self.path)
        elif len(begun) < len(names):
            text = "%s: holds files, but no results of an experiment (%s); choose another --out"
            raise ExperimentError(text % (self.path, ABOUT))
        os.makedirs(self.path, exist_ok=True)

    def _write_about(self, about: Dict[str, str]) -> None:
        text = json.dumps({"code": self._code, **about}, indent=2) + "\n"
        write_file(os.path.join(self.path, ABOUT), text.encode())

    def clear(self, kind: str) -> str:
        """Start over with the runs of a kind: delete simulated ones, and set aside all that cannot be computed again,
        those of robots, and what is damaged; return the folder of these, empty without any.

        Raises: ExperimentError if the folder is not ours.
        """
        self._make()
        aside = []
        for name in self._list_batches():
            _, runs = self._read_batch(name)
            if runs and runs[0].kind == SIMULATED:
                if kind == SIMULATED or runs[0].cell == OTHER_CELL:
                    os.remove(os.path.join(self._batches, name))
            elif not runs or kind == REAL or runs[0].cell == OTHER_CELL:
                aside.append(name)
        if kind == SIMULATED:
            self._remove_series(lambda name: True)
        for name in ("runs.csv", "series.csv"):
            with suppress(FileNotFoundError):
                os.remove(os.path.join(self.path, name))
        return self._set_aside(aside)

    def _remove_series(self, is_wanted: Callable[[str], bool]) -> None:
        """Remove our files of the folder series whose names are wanted."""
        for name in _list_names(self._series):
            if _SERIES_NAME.fullmatch(name) and is_wanted(name):
                with suppress(FileNotFoundError):
                    os.remove(os.path.join(self._series, name))

    def _set_aside(self, names: Sequence[str]) -> str:
        """Move batches to a new folder below set_aside, and return it; empty without any."""
        if not names:
            return ""
        folders = (os.path.join(self.path, "set_aside", str(number)) for number in itertools.count(1))
        folder = next(folder for folder in folders if not os.path.exists(folder))
        os.makedirs(folder)
        for name in names:
            os.replace(os.path.join(self._batches, name), os.path.join(folder, name))
        return folder

    def _list_batches(self) -> List[str]:
        return [name for name in _list_names(self._batches) if _BATCH_NAME.fullmatch(name)]

    def read_runs(self) -> List[Run]:
        """Return the runs of all finished batches, sorted.

        Raises: ExperimentError for a batch of another experiment or of other code.
        """
        found: Dict[Tuple[int, int, str], Run] = {}
        for name in self._list_batches():
            for _, run in self._list_runs(name):
                key = (run.cell, run.seed, run.kind)
                if key not in found or not run.remark:  # a trial on robots that counts replaces one that does not
                    found[key] = run
        return [found[key] for key in sorted(found)]

    def _read_batch(self, name: str) -> Tuple[str, List[Run]]:
        """Return the code of a batch, and its runs; none if the file is damaged, so that they are computed again."""
        try:
            with open(os.path.join(self._batches, name), encoding="utf-8") as file:
                header, *lines = map(json.loads, file)
            digest, code, kind = header["cell"], header["code"], header["kind"]
            cell = self._indices.get(digest, OTHER_CELL)
            runs = [
                Run(cell, int(line["seed"]), tuple(map(float, line["values"])), kind, line["remark"]) for line in lines
            ]
        except (ValueError, KeyError, TypeError):
            return "", []
        return code, runs if name == self._name_batch(digest, [run.seed for run in runs], code, kind) else []

    def _list_runs(self, name: str) -> List[Tuple[int, Run]]:
        """Return the runs of a batch that the experiment has, with their places in it. Raises: ExperimentError."""
        code, runs = self._read_batch(name)
        path = os.path.join(self._batches, name)
        remedy = "start over with --fresh, which sets trials on robots aside, or choose another --out"
        if any(run.kind == SIMULATED for run in runs) and self._code != code:
            raise ExperimentError(f"{path}: computed by other code ({code}, now {self._code}); {remedy}")
        if any(run.cell == OTHER_CELL for run in runs):
            raise ExperimentError(f"{path}: of an experiment with other parameters; {remedy}")
        count, seeds = len(self._experiment.metrics), self._experiment.seeds
        return [(place, run) for place, run in enumerate(runs) if len(run.values) == count and run.seed in seeds]

    def write_batch(self, runs: Sequence[Run]) -> None:
        """Keep the runs of one cell: once this returns they survive any end of the program."""
        digest, kind = self._cells[runs[0].cell], runs[0].kind
        seeds = [run.seed for run in runs]
        lines: List[Dict[str, Any]] = [{"cell": digest, "code": self._code, "kind": kind}]
        for run in runs:
            values = [value if math.isfinite(value) else repr(value) for value in run.values]  # JSON has no infinity
            lines.append({"seed": run.seed, "values": values, "remark": run.remark})
        name = self._name_batch(digest, seeds, self._code, kind)
        content = "".join(json.dumps(line) + "\n" for line in lines)
        if kind == REAL and os.path.exists(os.path.join(self._batches, name)):
            self._set_aside([name])  # damaged, or a trial that does not count
        write_file(os.path.join(self._batches, name), content.encode())

    def _name_batch(self, cell: str, seeds: Sequence[int], code: str, kind: str) -> str:
        identity = json.dumps([cell, list(seeds), code, kind])
        return hashlib.sha256(identity.encode()).hexdigest()[:24] + ".jsonl"

    def name_series(self, cell: int, seeds: Sequence[int]) -> str:
        """Return the path, without its ending, for what a batch records over time."""
        name = self._name_batch(self._cells[cell], seeds, self._code, SIMULATED)
        return os.path.join(self._series, name[: -len(".jsonl")])

    def read_series(self, cell: int, ending: str) -> Dict[int, np.ndarray]:
        """Return what the runs of a cell recorded over time, by seed, from the files that end so; arrays (T, ...)."""
        series: Dict[int, np.ndarray] = {}
        for name in self._list_batches():
            path = os.path.join(self._series, name[: -len(".jsonl")] + ending)
            if os.path.isfile(path):
                recorded = np.load(path, mmap_mode="r")
                own = [(place, run.seed) for place, run in self._list_runs(name) if run.cell == cell]
                series.update({seed: recorded[:, place] for place, seed in own})
        return series

    def list_missing(self, runs: Iterable[Run], kind: str = SIMULATED) -> List[RunKey]:
        """Return cell and seed of the runs of this kind that are still to be done, or do not count, cell by cell."""
        done: Set[RunKey] = {(run.cell, run.seed) for run in runs if run.kind == kind and not run.remark}
        every = ((cell, seed) for cell in range(len(self._cells)) for seed in self._experiment.seeds)
        return [key for key in every if key not in done]

    def write_table(self, runs: Sequence[Run]) -> str:
        """Write runs.csv and return its path."""
        path = os.path.join(self.path, "runs.csv")
        write_file(path, format_table(self._experiment, runs).encode())
        write_file(os.path.join(self.path, "series.csv"), format_csv(self._index_series()).encode())
        return path

    def _index_series(self) -> List[List[Any]]:
        """Return the rows of series.csv, sorted; cells are numbered from 1."""
        rows: List[List[Any]] = []
        for name in self._list_batches():
            files = [os.path.join("series", name[: -len(".jsonl")] + end) for end in (METRICS_ENDING, POSES_ENDING)]
            present = [file if os.path.isfile(os.path.join(self.path, file)) else "" for file in files]
            if any(present):
                own = ((place, run, self._experiment.cells[run.cell]) for place, run in self._list_runs(name))
                rows += [[run.cell + 1, *cell.varied.values(), run.seed, place, *present] for place, run, cell in own]
        varied = self._experiment.cells[0].varied
        return [["cell", *varied, "seed", "run", "metrics", "poses"], *sorted(rows, key=lambda row: (row[0], row[-4]))]


def _list_names(folder: str) -> List[str]:
    """Return what a folder holds, sorted; nothing if it is missing."""
    return sorted(os.listdir(folder)) if os.path.isdir(folder) else []


def read_about(path: str) -> Dict[str, str]:
    """Return what the about.json of a folder says of its results. Raises: ExperimentError if it is none of ours."""
    file = os.path.join(path, ABOUT)
    try:
        about = json.loads(read_file(file))
    except (OSError, RecursionError, ValueError) as error:
        reason = getattr(error, "strerror", None) or one_line(error)
        raise ExperimentError(f"{path}: no folder with results of run: {ABOUT}: {reason}") from error
    is_ours = isinstance(about, dict) and "code" in about and all(isinstance(value, str) for value in about.values())
    if not is_ours:
        raise ExperimentError(f"{path}: no folder with results of run: {ABOUT} is not written by run")
    return about


def read_results(path: str) -> Tuple[str, Experiment, Dict[str, str]]:
    """Return the text of the experiment whose results a folder holds, what it describes, and on what it ran.

    Raises: ExperimentError.
    """
    file = os.path.join(path, EXPERIMENT)
    if not os.path.isfile(file):
        raise ExperimentError(f"{path}: no {EXPERIMENT} in it, so not a folder of run")
    about = read_about(path)
    return (*read_experiment(file, os.path.join(path, about.get(FOLDER, ""))), about)


def format_table(experiment: Experiment, runs: Sequence[Run]) -> str:
    """Return the runs as CSV: what varies, seed, kind, metrics, remark; numbers so that they are read back exactly."""
    metrics = [metric.name for metric in experiment.metrics]
    rows: List[List[Any]] = [[*experiment.cells[0].varied, "seed", "kind", *metrics, "remark"]]
    for run in runs:
        varied = experiment.cells[run.cell].varied.values()
        rows.append([*varied, run.seed, run.kind, *map(repr, run.values), run.remark])
    return format_csv(rows)


def format_csv(rows: Iterable[Sequence[Any]]) -> str:
    """Return rows as CSV."""
    output = io.StringIO()
    csv.writer(output, lineterminator="\n").writerows(rows)
    return output.getvalue()
