"""The folder of an experiment's results: nothing in it is half-written, stale or counted twice.

    experiment.yaml    the file, as it was when the experiment began
    about.json         versions, commit, machine
    batches/*.jsonl    the runs of each finished batch, named by the digest of its cell, its seeds and the code
    series/*.npy       metrics over time of each batch, and poses if they are recorded
    times.csv          wall time of each batch: the only file that depends on the machine
    runs.csv           all runs, sorted; the same bytes however they were computed

A batch is written to a temporary file, which is renamed when the disk has it. Knows neither processes nor robots.
"""

import csv
import hashlib
import io
import json
import math
import os
import shutil
from contextlib import suppress
from typing import Any, Dict, Iterable, List, NamedTuple, Optional, Sequence, Set, Tuple

import numpy as np

from hero_node.safe_file import write_file

from .errors import ExperimentError
from .experiment_file import Cell, Experiment

SIMULATED = "simulated"
"""Kind of a run that was computed."""

REAL = "real"
"""Kind of a run on robots."""

OTHER_CELL = -1
"""Cell of a run of another experiment."""

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

    def __init__(self, path: str, experiment: Experiment, code: Optional[str]) -> None:
        """Use the folder path; code: digest of what computes the runs, None: only to read. Nothing is read or
        written yet."""
        self.path = path
        self._experiment = experiment
        self._code = code
        self._cells = [_digest_cell(experiment, cell) for cell in experiment.cells]
        self._batches = os.path.join(path, "batches")

    def begin(self, text: str, about: Dict[str, str], fresh: bool, kind: str = SIMULATED) -> List[Run]:
        """Create the folder, or continue with it; return the runs that it holds already.

        text: of the experiment's file; fresh: delete the earlier runs of this kind, and all of other experiments.
        Raises: ExperimentError if it holds runs of another experiment or of other code, or something else.
        """
        if os.path.isdir(self.path) and os.listdir(self.path) and not os.path.isdir(self._batches):
            raise ExperimentError(
                "%s: holds files, but no results of an experiment; choose another --out" % self.path
            )
        os.makedirs(self._batches, exist_ok=True)
        if fresh:
            self._delete(kind)
        runs = self.read_runs()
        write_file(os.path.join(self.path, "experiment.yaml"), text.encode())
        if fresh or not runs:
            about_text = json.dumps({"code": self._code, **about}, indent=2) + "\n"
            write_file(os.path.join(self.path, "about.json"), about_text.encode())
        return runs

    def _delete(self, kind: str) -> None:
        """Delete the runs of a kind, and all of other experiments: trials on robots outlive changes of the code."""
        for name in os.listdir(self._batches):
            _, runs = self._read_batch(name)
            if not runs or runs[0].kind == kind or runs[0].cell == OTHER_CELL:
                os.remove(os.path.join(self._batches, name))
        if kind == SIMULATED:
            shutil.rmtree(os.path.join(self.path, "series"), ignore_errors=True)
        for name in ("runs.csv", "times.csv"):
            with suppress(FileNotFoundError):
                os.remove(os.path.join(self.path, name))

    def read_runs(self) -> List[Run]:
        """Return the runs of all finished batches, sorted.

        Raises: ExperimentError for a batch of another experiment or of other code.
        """
        found: Dict[Tuple[int, int, str], Run] = {}
        for name in sorted(os.listdir(self._batches)):
            for _, run in self._list_runs(name) if name.endswith(".jsonl") else ():
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
            cell = self._cells.index(digest) if digest in self._cells else OTHER_CELL
            runs = [
                Run(cell, int(line["seed"]), tuple(map(float, line["values"])), kind, line["remark"]) for line in lines
            ]
        except (ValueError, KeyError, TypeError):
            return "", []
        return code, runs if name == self._name_batch(digest, [run.seed for run in runs], code, kind) else []

    def _list_runs(self, name: str) -> List[Tuple[int, Run]]:
        """Return the runs of a batch that the experiment has, with their places in it. Raises: ExperimentError."""
        code, runs = self._read_batch(name)
        path, remedy = os.path.join(self._batches, name), "start over with --fresh, or choose another --out"
        if any(run.kind == SIMULATED for run in runs) and self._code not in (None, code):
            raise ExperimentError("%s: computed by other code (%s, now %s); %s" % (path, code, self._code, remedy))
        if any(run.cell == OTHER_CELL for run in runs):
            raise ExperimentError("%s: of an experiment with other parameters; %s" % (path, remedy))
        count, seeds = len(self._experiment.metrics), self._experiment.seeds
        return [(place, run) for place, run in enumerate(runs) if len(run.values) == count and run.seed in seeds]

    def write_batch(self, runs: Sequence[Run]) -> None:
        """Keep the runs of one cell: once this returns they survive any end of the program."""
        assert self._code is not None
        digest, kind = self._cells[runs[0].cell], runs[0].kind
        seeds = [run.seed for run in runs]
        lines: List[Dict[str, Any]] = [{"cell": digest, "code": self._code, "kind": kind}]
        lines += [{"seed": run.seed, "values": list(map(_encode, run.values)), "remark": run.remark} for run in runs]
        name = self._name_batch(digest, seeds, self._code, kind)
        content = "".join(json.dumps(line) + "\n" for line in lines)
        write_file(os.path.join(self._batches, name), content.encode())

    def _name_batch(self, cell: str, seeds: Sequence[int], code: str, kind: str) -> str:
        identity = json.dumps([cell, list(seeds), code, kind])
        return hashlib.sha256(identity.encode()).hexdigest()[:24] + ".jsonl"

    def name_series(self, cell: int, seeds: Sequence[int]) -> str:
        """Return the path, without its ending, for what a batch records over time."""
        folder = os.path.join(self.path, "series")
        os.makedirs(folder, exist_ok=True)
        assert self._code is not None
        return os.path.join(
            folder, self._name_batch(self._cells[cell], seeds, self._code, SIMULATED)[: -len(".jsonl")]
        )

    def read_series(self, cell: int, ending: str) -> Dict[int, np.ndarray]:
        """Return what the runs of a cell recorded over time, by seed, from the files that end so; arrays (T, ...)."""
        series: Dict[int, np.ndarray] = {}
        for name in sorted(os.listdir(self._batches)):
            path = os.path.join(self.path, "series", name[: -len(".jsonl")] + ending)
            if name.endswith(".jsonl") and os.path.isfile(path):
                recorded = np.load(path, mmap_mode="r")
                own = [(place, run.seed) for place, run in self._list_runs(name) if run.cell == cell]
                series.update({seed: recorded[:, place] for place, seed in own})
        return series

    def note_time(self, cell: int, seeds: Sequence[int], wall_s: float) -> None:
        """Append how long a batch took."""
        path = os.path.join(self.path, "times.csv")
        with open(path, "a", encoding="utf-8") as file:
            if file.tell() == 0:
                file.write("cell,first_seed,runs,wall_s\n")
            file.write("%d,%d,%d,%.3f\n" % (cell, seeds[0], len(seeds), wall_s))

    def list_missing(self, runs: Iterable[Run], kind: str = SIMULATED) -> List[RunKey]:
        """Return cell and seed of the runs of this kind that are still to be done, or do not count, cell by cell."""
        done: Set[RunKey] = {(run.cell, run.seed) for run in runs if run.kind == kind and not run.remark}
        every = ((cell, seed) for cell in range(len(self._cells)) for seed in self._experiment.seeds)
        return [key for key in every if key not in done]

    def write_table(self, runs: Sequence[Run]) -> str:
        """Write runs.csv and return its path."""
        path = os.path.join(self.path, "runs.csv")
        write_file(path, format_table(self._experiment, runs).encode())
        return path


def _digest_cell(experiment: Experiment, cell: Cell) -> str:
    digest = hashlib.sha256(experiment.describe_cell(cell).encode())
    for path in experiment.list_files(cell).values():
        with open(path, "rb") as file:
            digest.update(file.read())
    return digest.hexdigest()


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


def _encode(value: float) -> Any:
    """Return value for JSON, which has no infinity."""
    return value if math.isfinite(value) else repr(value)
