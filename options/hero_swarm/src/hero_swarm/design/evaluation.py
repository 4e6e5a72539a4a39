"""Runs of candidates in the mission's world: computed by workers, kept in the history of a design."""

import functools
import math
import os
import sys
import zlib
from concurrent.futures import BrokenExecutor, CancelledError
from typing import Any, Callable, Dict, Iterator, List, Sequence, Tuple

import numpy as np
from tqdm import tqdm

from hero_node.files import read_file

from ..experiments.computing.batch import one_at_a_time, run_trial, take_values
from ..experiments.computing.cell_setup import set_up
from ..experiments.computing.code_version import check_suite, hash_suite
from ..experiments.errors import ExperimentError, report_place
from ..experiments.runner import REPORT_S, choose_batch
from .kinds import Kind, plan_machines, plan_networks, plan_numbers
from .mission import Mission
from .search import RACE_RUNS, RUNS, adapt, evolve, race

METHODS: Dict[str, Tuple[Callable[[Mission], Kind], Callable[..., np.ndarray], int]] = {
    "chocolate": (plan_machines, race, RACE_RUNS),
    "maple": (functools.partial(plan_machines, is_tree=True), race, RACE_RUNS),
    "evostick": (plan_networks, evolve, 20 * RUNS),
    "cma": (plan_numbers, adapt, 50 * RUNS),
}
"""Kind of candidates of each method, its search, and the least runs that it needs."""


def score_runs(mission: Mission, suite: str, method: str, genomes: np.ndarray, seeds: Sequence[int]) -> List[float]:
    """Return the scores of runs, each with its candidate (W, G) and seed. Raises: ExperimentError."""
    with one_at_a_time:
        check_suite(suite)
        experiment = mission.experiment
        with report_place("the mission with seed %d" % seeds[0], experiment.sources):
            setup = set_up(experiment, experiment.cells[0])._replace(behavior=METHODS[method][0](mission).make(genomes))
            series, ends = run_trial(experiment, setup.build_trial(seeds))
        scores = [take_values(experiment, series[: end + 1, world])[0] for world, end in enumerate(ends)]
    if any(map(math.isnan, scores)):
        raise ExperimentError(f"score {experiment.metrics[0].name}: is nan with seed {seeds[0]}, but must be a number")
    return scores


class History:
    """The runs of one design in their order, a line each: candidate (digest of its numbers), seed, score, check."""

    def __init__(self, path: str, about: str) -> None:
        """Read what is there, but a last line without its end; about: first line. Raises: ExperimentError."""
        self.path, self._check, self._next = path, 0, 0
        self.runs: List[Tuple[str, int, float]] = []
        content, head = read_file(path).decode(errors="replace"), f"# {about}\ncandidate,seed,score,check\n"
        lines = content[: content.rfind("\n") + 1].splitlines(keepends=True)
        if len(lines) > 2 and "".join(lines[:2]) != head:
            text = "%s: is of another mission, code or options (%s; now: %s): use --fresh, or copy the mission"
            raise ExperimentError(text % (path, lines[0].strip(), about))
        for number, line in enumerate(lines[2:], 3):
            run, _, check = line.strip().rpartition(",")
            if check != self._seal(run):
                remedy = "delete it and all below: the runs above are kept, the others computed again"
                raise ExperimentError("%s, line %d: is damaged; %s" % (path, number, remedy))
            candidate, seed, score = run.split(",")
            self.runs.append((candidate, int(seed), float(score)))
        if not self.runs:
            with open(path, "wb") as file:
                file.write(head.encode())
        else:
            os.truncate(path, len("".join(lines)))

    def _seal(self, run: str) -> str:
        """Return the check of a line, on which those of all later lines depend."""
        self._check = zlib.crc32(run.encode(), self._check)
        return "%08x" % self._check

    def recall(self, keys: Sequence[Tuple[str, int]]) -> List[float]:
        """Return the scores of the first of these runs that are in the file already."""
        known = self.runs[self._next : self._next + len(keys)]
        assert [run[:2] for run in known] == list(keys[: len(known)])  # same first line, same runs
        self._next += len(known)
        return [score for _, _, score in known]

    def add(self, keys: Sequence[Tuple[str, int]], scores: Sequence[float]) -> None:
        """Keep the next runs: once this returns they survive any end of the program."""
        runs = [(*key, score) for key, score in zip(keys, scores)]
        with open(self.path, "a", encoding="utf-8") as file:
            file.writelines("%s,%s\n" % (line, self._seal(line)) for line in map("%s,%d,%r".__mod__, runs))
            file.flush()
            os.fsync(file.fileno())
        self.runs += runs
        self._next += len(runs)


class Evaluation:
    """Scores of candidates, larger ones better; bar: budget, time left, and the best mean score of the last step."""

    def __init__(self, mission: Mission, options: Any, history: History, workers: Any, seed: int) -> None:
        """Begin; options: method and budget; workers: an executor, and their number; seed: before the first one."""
        self._common, self._mission, self._history = (mission, hash_suite(), options.method), mission, history
        self._workers, self._seed, self._is_first = workers, seed, True
        self._is_stacked = METHODS[options.method][0](mission).is_stacked
        begun = {"total": options.budget, "initial": len(history.runs), "desc": history.path}
        self.bar = tqdm(mininterval=0.1 if sys.stderr.isatty() else REPORT_S, unit="run", **begun)

    def __call__(self, genomes: np.ndarray, seeds: range) -> np.ndarray:
        """Return the scores (C, seeds). Raises: ExperimentError, also if the first ones tell no candidates apart."""
        names = ["%08x" % zlib.crc32(genome.tobytes()) for genome in genomes]
        keys = [(name, self._seed + seed) for name in names for seed in seeds]
        scores = self._history.recall(keys)
        for own in self._compute(np.repeat(genomes, len(seeds), axis=0), keys, len(scores), len(seeds)):
            self._history.add(keys[len(scores) : len(scores) + len(own)], own)
            scores += own
            self.bar.update(len(own))
        values = self._mission.sign * np.array(scores).reshape(len(genomes), len(seeds))
        if self._is_first and len(genomes) > 1 and (values == values[0, 0]).all():
            text = "score: is %g in all %d runs of %d controllers: it tells none apart; change score or mission"
            raise ExperimentError(text % (scores[0], len(scores), len(genomes)))
        self._is_first = False
        self.bar.set_postfix(best="%.4g" % (self._mission.sign * values.mean(axis=1).max()), refresh=False)
        return values

    def _compute(self, genomes: np.ndarray, keys: List[Any], first: int, each: int) -> Iterator[List[float]]:
        """Yield the scores of all runs from the first one on, in their order. Raises: ExperimentError."""
        executor, count = self._workers
        size = max(1, min(choose_batch(self._mission.experiment, 0), math.ceil((len(keys) - first) / count)))
        ends = range(first + size, len(keys), size) if self._is_stacked else range(0, len(keys), each)
        places = [first, *(end for end in ends if end > first), len(keys)] if first < len(keys) else []
        parts, seeds = zip(places, places[1:]), [seed for _, seed in keys]
        futures = [executor.submit(score_runs, *self._common, genomes[a:b], seeds[a:b]) for a, b in parts]
        try:
            for future in futures:
                yield future.result()
        except (BrokenExecutor, CancelledError) as error:
            text = "a worker died (%s; out of memory?): start again, what is computed is kept"
            raise ExperimentError(text % error) from error
        finally:
            for future in futures:
                future.cancel()
