"""Computes some runs of one cell at once, in virtual time; knows neither the workers it runs in nor the results.

Metrics are taken once per second of simulated time. A run has the same values alone and in any batch.
"""

import io
import json
import math
import os
import sys
import threading
from contextlib import contextmanager, suppress
from typing import Any, Iterator, List, NamedTuple, Sequence, Tuple

import numpy as np
from tqdm import tqdm

from hero_node.files import make_new_name, name_file, write_file

from ...metrics.own import State, is_own, measure_metric
from ...trial import Trial
from ..errors import report_place
from ..experiment_file import Experiment, Metric
from ..results_folder import METRICS_ENDING, POSES_ENDING, Run
from .cell_setup import check_setup, set_up
from .code_version import check_suite, hash_code

SAMPLE_S = 1.0
"""Time between two samples of the metrics."""


class Batch(NamedTuple):
    """Some runs of one cell, as a worker takes them: it reads no file but its modules of the suite.

    Attributes:
        experiment: with this cell alone.
        suite: digest of the suite's sources.
        cell: index of the cell in the whole experiment.
        stem: path of the files for metrics over time and poses, without their endings.
    """

    experiment: Experiment
    suite: str
    cell: int
    seeds: Tuple[int, ...]
    stem: str


one_at_a_time = threading.RLock()
"""Modules of users are those of one batch."""


def load_checked(experiment: Experiment) -> str:
    """Check all cells by the begin of a run, before all runs; return a digest of the code. Raises: ExperimentError."""
    check_setup(experiment, filter(is_own, list_sources(experiment)))
    built = set()
    for cell in tqdm(experiment.cells, "checking", unit=" cells", leave=False, disable=None, file=sys.stderr):
        setup = set_up(experiment, cell)
        needed = [{**cell.settings, "delay_s": None}, cell.behavior, cell.start, cell.own]
        settings = json.dumps(needed, sort_keys=True)
        if settings not in built:
            # Two worlds, as an own metric may give one number for all.
            trial = setup.build_trial([experiment.seeds[0]] * 2)
            with report_place(f"{cell.behavior}, {cell.label}", experiment.sources):
                measure(experiment, trial.state)
            built.add(settings)
    return hash_code(experiment.list_code())


def compute_batch(experiment: Experiment, suite: str, cell: int, seeds: Sequence[int], stem: str) -> List[Run]:
    """Return the runs of a Batch with these fields.

    Raises: ExperimentError, also for whatever the behavior raises, and in a process with other sources of the suite.
    """
    with one_at_a_time:
        check_suite(suite)
        setup = set_up(experiment, experiment.cells[0])
        trial = setup.build_trial(seeds)
        label = "%s, %s with seeds %d to %d" % (setup.cell.behavior, setup.cell.label, seeds[0], seeds[-1])
        place = report_place(label, experiment.sources)
        with _record_poses(experiment, trial, stem + POSES_ENDING) as poses, place:
            series, ends = run_trial(experiment, trial, poses)
        content, is_sample = io.BytesIO(), np.arange(len(series))[:, None] <= np.array(ends)
        np.save(content, np.where(is_sample[..., None], series, np.nan).astype(np.float32))
        write_file(stem + METRICS_ENDING, content.getvalue())  # to a file, numpy does not say that the disk is full
    return [
        Run(cell, seed, take_values(experiment, series[: ends[world] + 1, world])) for world, seed in enumerate(seeds)
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


def run_trial(experiment: Experiment, trial: Trial, poses: Any = None) -> Tuple[np.ndarray, List[int]]:
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


def take_values(experiment: Experiment, series: np.ndarray) -> Tuple[float, ...]:
    """Return the values of the columns from the samples (T, metrics) of one run."""
    names = list_sources(experiment)
    return tuple(_take(metric, series[:, names.index(metric.source)]) for metric in experiment.metrics)


def _take(metric: Metric, values: np.ndarray) -> float:
    if metric.bound is not None:
        held = metric.bound.holds(values).nonzero()[0]
        return float(held[0] * SAMPLE_S) if len(held) else math.inf
    if metric.last_s:
        # One after the other: the result does not depend on how numpy adds.
        last = values[-max(1, round(metric.last_s / SAMPLE_S)) :].tolist()
        return sum(last) / len(last)
    return float(values[-1])
