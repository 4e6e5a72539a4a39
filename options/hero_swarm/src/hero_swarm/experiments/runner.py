"""Computes the runs that an experiment lacks, and writes the table of all runs: what the program run does."""

import argparse
import functools
import itertools
import math
import os
import sys
import time
from contextlib import contextmanager
from operator import itemgetter
from typing import Iterator, List, Optional, Sequence, Tuple

from hero_node.parameters import explicit_ids_option, within

from .computing import engines
from .computing.batch import Batch, compute_batch, load_checked
from .computing.code_version import describe_machine, hash_suite
from .computing.engines import Engine
from .computing.progress import show_progress
from .experiment_file import MAX_ROBOTS, MAX_RUNS, Experiment, read_experiment
from .results_folder import FOLDER, REAL, SIMULATED, ResultsFolder, Run, RunKey

MAX_BATCH = 1000

BATCH_ROBOT_S = 480_000.0
"""Robot-seconds in a batch: with numba 10 to 20 s of work. Beyond some thousand robots at once, more save nothing."""

_BATCHES_PER_WORKER = 2
"""At least, where there are enough runs: no worker idles long while another computes the last batch."""

DASK = "dask:"

IN_WORLDS = "_phantoms"
"""End of the names of the file and the folder of phantoms for an experiment."""


def _parse_part(text: str) -> Tuple[int, int]:
    part, slash, parts = text.partition("/")
    if not (slash and part.isdecimal() and parts.isdecimal() and 1 <= int(part) <= int(parts)):
        raise argparse.ArgumentTypeError(f"{text!r} must be K/N with K from 1 to N, such as 3/16")
    return int(part), int(parts)


def _parse_executor(text: str) -> str:
    if not text.startswith(DASK) or text == DASK:
        raise argparse.ArgumentTypeError(f"{text!r} must be dask:ADDRESS, as tls://HOST:PORT or tcp://127.0.0.1:PORT")
    return text[len(DASK) :]


def add_engine_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that say where runs are computed."""
    add, cores = parser.add_argument, os.cpu_count() or 1
    add("--jobs", type=within(1, 1024, int), default=cores, help="worker processes (%(default)s)")
    text = "a Dask cluster: tls://HOST:PORT, tcp://127.0.0.1:PORT, or scheduler file"
    add("--executor", type=_parse_executor, metavar="dask:ADDRESS", help=text)
    add("--part", type=_parse_part, default=(1, 1), metavar="K/N", help="only the K-th of N parts")


def parse_options(arguments: Optional[Sequence[str]]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="run", description="Run an experiment: all seeds of all cells.")
    add = parser.add_argument
    add("file", metavar="EXPERIMENT.yaml", help="experiment file")
    add("--out", metavar="FOLDER", help="folder of the results (the file's name without .yaml)")
    add("--batch", type=within(1, MAX_BATCH, int), help="runs that are computed together (10 to 20 s of work)")
    add("--seeds", type=within(1, MAX_RUNS, int), metavar="N", help="only the first N seeds of the file")
    add_engine_options(parser)
    add("--robots", type=explicit_ids_option, metavar="IDS", help="run trials on these robots instead, such as 0-9")
    add("--frame", default="map", help="of robots' poses: of localize (map), or world in the simulator")
    text = "of `calibrate`: robots whose motors are calibrated are driven by pulses, if the behavior wants it"
    add("--calibration", metavar="FOLDER", default="~/hero_calibration", help=text)
    text = "delete earlier simulated runs in the folder; with --robots set trials on robots aside instead"
    add("--fresh", action="store_true", help=text)
    return parser.parse_args(arguments)


def choose_batch(experiment: Experiment, cell: int) -> int:
    """Return how many runs of a cell are computed together."""
    robots = int(experiment.cells[cell].settings["robots"])
    assert robots <= MAX_ROBOTS
    return max(1, min(MAX_BATCH, math.ceil(BATCH_ROBOT_S / (robots * experiment.time_s))))


def list_batches(
    experiment: Experiment, missing: Sequence[RunKey], size: Optional[int], workers: int, folder: ResultsFolder
) -> Iterator[Batch]:
    """Yield batches of the missing runs, which are sorted by cell.

    size: runs that are computed together; None: as many as is fast, but something to do for each of the workers.
    """
    share = math.ceil(len(missing) / (_BATCHES_PER_WORKER * workers))
    experiment = experiment._replace(folder=os.path.abspath(experiment.folder))  # workers may be in another one
    for cell, keys in itertools.groupby(missing, key=itemgetter(0)):
        seeds, own = [seed for _, seed in keys], experiment._replace(cells=(experiment.cells[cell],))
        length = size or min(share, choose_batch(experiment, cell))
        for start in range(0, len(seeds), length):
            chosen = tuple(seeds[start : start + length])
            yield Batch(own, hash_suite(), cell, chosen, os.path.abspath(folder.name_series(cell, chosen)))


def choose_engine(options: argparse.Namespace) -> Engine:
    """Return the workers that the options name, which a with statement starts."""
    if options.executor is None:
        return Engine(functools.partial(engines.open_pool, options.jobs), options.jobs)
    executor, workers = engines.open_dask(options.executor, hash_suite)
    return Engine(lambda: executor, workers)


@contextmanager
def open_folder(options: argparse.Namespace) -> Iterator[Tuple[Experiment, ResultsFolder, List[Run]]]:
    """Give the experiment of a file, the folder of its results, created if missing, and its runs.

    Other programs cannot add runs of the same kind meanwhile, unless both compute parts. Raises: ExperimentError.
    """
    text, experiment = read_experiment(options.file)
    experiment = experiment._replace(seeds=experiment.seeds[: options.seeds])
    code = load_checked(experiment)
    experiment.sources.complete()
    path, kind = options.out or os.path.splitext(options.file)[0], SIMULATED if options.robots is None else REAL
    folder = ResultsFolder(path, experiment, code)
    about = {**describe_machine(), FOLDER: os.path.relpath(experiment.folder or ".", path)}
    if options.fresh:
        with folder.hold(kind):
            aside = folder.clear(kind)
        if aside:
            print(f"{aside}: set aside: damaged batches, and trials on robots that do not count now", file=sys.stderr)
    with folder.hold(kind, is_shared=options.part[1] > 1):
        yield experiment, folder, folder.begin(text, about)


def run_experiment(options: argparse.Namespace) -> str:
    """Run what is missing; return a line for users. Raises: ExperimentError."""
    with open_folder(options) as (experiment, folder, runs):
        return _run_missing(options, experiment, folder, runs)


def _run_missing(options: argparse.Namespace, experiment: Experiment, folder: ResultsFolder, runs: List[Run]) -> str:
    part, parts = options.part
    # Whatever is there already, the parts share out all runs in the same way.
    own = set(folder.list_missing(())[part - 1 :: parts])
    missing = [key for key in folder.list_missing(runs) if key in own]
    if missing:
        began_s = time.monotonic()
        with choose_engine(options) as engine, show_progress(len(missing) + len(runs), len(runs)) as progress:
            batches = list_batches(experiment, missing, options.batch, engine.workers, folder)
            for _, computed in engine.compute(compute_batch, batches):
                folder.write_batch(computed)
                progress.update(len(computed))
        print(f"{len(missing)} runs in {time.monotonic() - began_s:.1f} s", file=sys.stderr)
    runs = folder.read_runs()
    left = folder.list_missing(runs)
    cells, count = len(experiment.cells), len(experiment.seeds)
    if left:
        return "%s: %d of %d runs are still to be computed, by other parts" % (folder.path, len(left), cells * count)
    line = "%s: all runs of %d cells with %d seeds each" % (folder.write_table(runs), cells, count)
    in_worlds = os.path.splitext(options.file)[0] + IN_WORLDS
    if "world" in experiment.cells[0].varied or os.path.isdir(in_worlds):
        return line
    return f"{line}; not tried with other assumptions: rosrun hero_swarm phantoms {options.file}"
