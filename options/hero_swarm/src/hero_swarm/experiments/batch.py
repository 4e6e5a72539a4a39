"""Computes some runs of one cell at once, in virtual time. Runs in worker processes; knows neither them nor
the results.

Metrics are taken once per second of simulated time. A run has the same values alone and in any batch.
"""

import io
import json
import math
import os
import sys
import threading
import time
from contextlib import contextmanager, suppress
from functools import lru_cache
from typing import Any, Iterator, List, NamedTuple, Sequence, Tuple

import numpy as np
from tqdm import tqdm

from hero_node import HeroError
from hero_node.files import make_new_name, name_file, write_file
from hero_sim.world import Arena, load_arena, read_known

from ..behavior import Behavior, Objects
from ..behaviors import find_behavior
from ..metrics.own import State, measure_metric
from ..sources import Sources
from ..trial import OPEN, Trial
from .code_version import check_suite
from .errors import ExperimentError, report_place
from .experiment_file import ERROR_KEYS, ERRORS, Cell, Experiment, Metric, parse_experiment
from .results_folder import METRICS_ENDING, POSES_ENDING, Run
from .starts import place_all, place_objects

SAMPLE_S = 1.0
"""Time between two samples of the metrics."""


def load_checked(experiment: Experiment) -> None:
    """Build the first run of all cells that differ in it, to report errors before anything runs.

    Raises: ExperimentError.
    """
    built = set()
    for cell in tqdm(experiment.cells, "checking", unit=" cells", leave=False, disable=None, file=sys.stderr):
        make_behavior(experiment, cell)
        needed = [{**cell.settings, "delay_s": None}, cell.behavior, cell.start, cell.own]
        settings = json.dumps(needed, sort_keys=True)
        if settings not in built:
            # Two worlds, as an own metric may give one number for all.
            trial = build_trial(experiment, cell, [experiment.seeds[0]] * 2)
            with report_place(cell.label, experiment.sources):
                measure(experiment, trial.state)
            built.add(settings)


def build_trial(experiment: Experiment, cell: Cell, seeds: Sequence[int]) -> Trial:
    """Return the worlds of a cell with these seeds, at their start.

    Raises: ExperimentError with the line of what cannot be used.
    """
    settings, files = cell.settings, experiment.list_files(cell)
    for name, path in files.items():
        if not experiment.sources.find(path) and not os.path.exists(path):
            text = "%s: %s %s cannot be read: no such file; paths are relative to the experiment's file, or absolute"
            raise ExperimentError(text % (experiment.places[name], name, path))
    behavior = make_behavior(experiment, cell)
    with _at(experiment, "arena"):
        arena = load_cell_arena(experiment, cell)
        pushes = any(isinstance(sensor, Objects) for sensor in behavior.sensors().values())
        if pushes and not arena.objects:
            raise ExperimentError(f"{cell.behavior} pushes objects: arena must have them, as box does")
    with _at(experiment, "start"):
        starts = place_robots(experiment, cell, seeds)
    with _at(experiment, "objects"):
        objects = place_objects(settings.get("objects", "arena"), arena, starts, seeds)
    with _at(experiment, "errors"):
        scale = _find_scale(settings.get("errors", "default"))
        ids, read = range(settings["robots"]), experiment.sources.read
        known = read_known(files["errors"], ids, read) if "errors" in files else []
        known += ["%s=%r" % (name.partition(".")[2], settings[name]) for name in ERROR_KEYS if name in settings]
        delay_s, wifi = settings.get("delay_s", 0.0), settings.get("wifi", "ideal")
        return Trial(
            behavior, arena, settings["robots"], seeds,
            starts=starts, objects=objects, errors=scale, known_errors=known, delay_s=delay_s, wifi=wifi,
        )  # fmt: skip


def _find_scale(errors: Any) -> float:
    """Return by how much robots differ: a number, or a name; a file is put over usual differences."""
    return ERRORS.get(errors, ERRORS["default"]) if isinstance(errors, str) else float(errors)


@contextmanager
def _at(experiment: Experiment, name: str) -> Iterator[None]:
    """Name the line of what is wrong; what is not in the file is the behavior's need."""
    try:
        yield
    except (HeroError, TypeError, ValueError) as error:
        place = experiment.places.get(name, experiment.places["behavior"])
        raise ExperimentError(f"{place}: {error}") from error


def make_behavior(experiment: Experiment, cell: Cell) -> Behavior:
    """Return the behavior of a cell. Raises: ExperimentError."""
    with _at(experiment, "behavior"):
        kind = find_behavior(experiment.locate(cell.behavior), experiment.sources)
        allowed = kind().numbers()
    known = set(allowed)
    for name in cell.parameters.keys() - known:
        with _at(experiment, "behavior"):
            others = [find_behavior(experiment.locate(one), experiment.sources) for one in experiment.list_behaviors()]
        # Where behaviors vary, a baseline need not have what the others have.
        every = {key: None for other in others for key in other().numbers()}
        if name in cell.own or name not in every:
            whose, has = (cell.behavior, allowed) if name in cell.own else (experiment.behavior, every)
            text = "%s: %s has no parameter %r; there are %s"
            raise ExperimentError(text % (experiment.places[name], whose, name, ", ".join(has)))
    with _at(experiment, "rate_hz"):
        return kind(**{name: value for name, value in cell.parameters.items() if name in known})


def load_cell_arena(experiment: Experiment, cell: Cell) -> Arena:
    """Return the arena of a cell, an open plane without one. Raises: OptionError."""
    path = experiment.list_files(cell).get("arena")
    if path is None:
        return load_arena(cell.settings["arena"]) if "arena" in cell.settings else OPEN
    arena: Arena = experiment.sources.load(path, lambda: load_arena(path, experiment.sources.read))
    return arena


def place_robots(experiment: Experiment, cell: Cell, seeds: Sequence[int]) -> np.ndarray:
    """Return where the robots of runs begin (W, N, 3). Raises: ExperimentError."""
    start = cell.start._replace(file=experiment.list_files(cell).get("file"))
    arena, robots = load_cell_arena(experiment, cell), cell.settings["robots"]
    if cell.settings.get("objects", "arena") != "arena":
        arena = arena._replace(objects=())  # they are placed clear of the robots
    return place_all(start, arena, robots, seeds, experiment.sources.read)


class Inputs(NamedTuple):
    """All that runs depend on, as they are sent to workers.

    Attributes:
        text, folder: of the experiment's file.
        sources: all files that it names.
        suite: digest of the suite's sources.
    """

    text: str
    folder: str
    sources: Sources
    suite: str


_one_at_a_time = threading.RLock()
"""Modules of users are those of one experiment."""


def compute_batch(inputs: Inputs, cell_index: int, seeds: Sequence[int], stem: str) -> Tuple[List[Run], float]:
    """Return the runs of one cell with these seeds, and the seconds that took.

    Metrics over time, and poses, go to files that begin with stem.
    Raises: ExperimentError, also for whatever the behavior raises, and in a process with other sources of the suite.
    """
    with _one_at_a_time:
        check_suite(inputs.suite)
        began_s = time.monotonic()
        return _compute_runs(inputs, cell_index, seeds, stem), time.monotonic() - began_s


@lru_cache(maxsize=1)
def _parse(text: str, folder: str) -> Experiment:
    """Return the experiment of the last batch again: one with many cells takes seconds."""
    return parse_experiment(text, "the experiment", folder)


def _compute_runs(inputs: Inputs, cell_index: int, seeds: Sequence[int], stem: str) -> List[Run]:
    # Not what was made of its files: a module may remember what it did in another batch.
    experiment = _parse(inputs.text, inputs.folder)._replace(sources=inputs.sources)
    cell = experiment.cells[cell_index]
    trial = build_trial(experiment, cell, seeds)
    label = "%s with seeds %d to %d" % (cell.label, seeds[0], seeds[-1])
    place = report_place(label, experiment.sources)
    with _record_poses(experiment, trial, stem + POSES_ENDING) as poses, place:
        series, ends = _run(experiment, trial, poses)
    _write_metrics(stem + METRICS_ENDING, series, ends)
    return [
        Run(cell_index, seed, take_values(experiment, series[: ends[world] + 1, world]))
        for world, seed in enumerate(seeds)
    ]


def list_sources(experiment: Experiment) -> List[str]:
    """Return the metrics that are sampled, those of the columns and of the condition that ends a run."""
    names = [metric.source for metric in experiment.metrics]
    if experiment.until is not None:
        names.append(experiment.until.metric)
    return sorted(set(names))


def measure(experiment: Experiment, state: State) -> Tuple[np.ndarray, np.ndarray]:
    """Return a sample (W, metrics), and whether the condition that ends a run holds (W,). Raises: ValueError."""
    names, until = list_sources(experiment), experiment.until
    located = map(experiment.locate, names)
    sample = np.column_stack([measure_metric(name, state, experiment.sources) for name in located])
    holds = np.zeros(len(sample), dtype=bool) if until is None else until.holds(sample[:, names.index(until.metric)])
    return sample, holds


@contextmanager
def _record_poses(experiment: Experiment, trial: Trial, path: str) -> Iterator[Any]:
    """Give an array (T, W, N, 3) on the disk, as it may be more than fits into memory; None if nothing is recorded.

    The file takes its name at the end of the context, unless that raises. Raises: OSError if the disk is full.
    """
    if not experiment.record_hz:
        yield None
        return
    new = make_new_name(path)
    shape = (math.floor(experiment.time_s * experiment.record_hz + 1e-9) + 1, *trial.poses.shape)
    try:
        with name_file(path):
            poses: Any = np.lib.format.open_memmap(new, "w+", np.float32, shape)  # type: ignore[no-untyped-call]
            with open(new, "r+b") as file:  # else a full disk would kill this process when it writes into the array
                os.posix_fallocate(file.fileno(), 0, os.fstat(file.fileno()).st_size)
        yield poses
        poses.flush()
        os.replace(new, path)
    finally:
        with suppress(FileNotFoundError):
            os.remove(new)


def _run(experiment: Experiment, trial: Trial, poses: Any) -> Tuple[np.ndarray, List[int]]:
    """Run a trial; return the samples (T, W, metrics) and the last sample of each world.

    poses: array of _record_poses() that is filled.
    """
    worlds = len(trial.poses)
    samples = math.floor(experiment.time_s / SAMPLE_S + 1e-9) + 1
    series = np.full((samples, worlds, len(list_sources(experiment))), np.nan)
    ends = np.full(worlds, samples - 1)
    running = np.ones(worlds, dtype=bool)
    now_s, recorded = 0.0, 0
    while True:
        if poses is not None and now_s >= recorded / experiment.record_hz - 1e-6:
            poses[recorded] = np.where(running[:, None, None], trial.poses, np.nan)
            recorded += 1
        sample = math.floor(now_s / SAMPLE_S + 1e-6)
        if sample < samples and np.isnan(series[sample]).all():
            series[sample], holds = measure(experiment, trial.state)
            ended = running & holds
            ends[ended], running[ended] = sample, False
        if now_s >= experiment.time_s - 1e-6 or not running.any():
            break
        now_s = trial.step()
    if poses is not None:
        poses[recorded:] = np.nan
    return series, ends.tolist()


def _write_metrics(path: str, series: np.ndarray, ends: List[int]) -> None:
    """Write the samples (T, W, metrics) of each world up to its last one."""
    is_sample = np.arange(len(series))[:, None] <= np.array(ends)
    content = io.BytesIO()  # to a file, numpy does not say that the disk is full
    np.save(content, np.where(is_sample[..., None], series, np.nan).astype(np.float32))
    write_file(path, content.getvalue())


def take_values(experiment: Experiment, series: np.ndarray) -> Tuple[float, ...]:
    """Return the values of the columns from the samples (T, metrics) of one run."""
    names = list_sources(experiment)
    return tuple(_take(metric, names, series) for metric in experiment.metrics)


def _take(metric: Metric, names: Sequence[str], series: np.ndarray) -> float:
    """Return the value of a column from the samples (T, metrics) of one run."""
    values = series[:, names.index(metric.source)]
    if metric.bound is not None:
        held = metric.bound.holds(values).nonzero()[0]
        return float(held[0] * SAMPLE_S) if len(held) else math.inf
    if metric.last_s:
        # One after the other: the result does not depend on how numpy adds.
        last = values[-max(1, round(metric.last_s / SAMPLE_S)) :].tolist()
        return sum(last) / len(last)
    return float(values[-1])
