"""Runs of candidates in the mission's world: computed by workers, kept in the history of a design."""

import functools
import math
import os
import zlib
from typing import Any, Callable, Dict, Iterator, List, Sequence, Tuple

import numpy as np

from hero_node.files import read_file

from ..experiments.computing.batch import one_at_a_time, run_trial, take_values
from ..experiments.computing.cell_setup import set_up
from ..experiments.computing.code_version import check_suite, hash_suite
from ..experiments.computing.engines import Engine
from ..experiments.errors import ExperimentError, report_place
from ..experiments.experiment_file import Experiment
from ..experiments.runner import choose_batch
from .kinds import Kind, Machines, Networks, Numbers
from .mission import Mission
from .search import RACE_RUNS, RUNS, adapt, evolve, race

METHODS: Dict[str, Tuple[Callable[[Mission], Kind], Callable[..., np.ndarray], int]] = {
    "chocolate": (Machines, race, RACE_RUNS),
    "maple": (functools.partial(Machines, is_tree=True), race, RACE_RUNS),
    "evostick": (Networks, evolve, 20 * RUNS),
    "cma": (Numbers, adapt, 50 * RUNS),
}
"""Kind of candidates of each method, its search, and the least runs that it needs."""


def score_runs(
    experiment: Experiment, suite: str, kind: Kind, genomes: np.ndarray, seeds: Sequence[int]
) -> List[float]:
    """Return the scores of runs, each with its candidate (W, G) and seed. Raises: ExperimentError."""
    with one_at_a_time:
        check_suite(suite)
        with report_place("the mission with seed %d" % seeds[0], experiment.sources):
            setup = set_up(experiment, experiment.cells[0])
            trial = setup._replace(behavior=kind.make(genomes, setup.behavior)).build_trial(seeds)
            series, ends = run_trial(experiment, trial)
        scores = [take_values(experiment, series[: end + 1, world])[0] for world, end in enumerate(ends)]
    if any(map(math.isnan, scores)):
        text = "%s: score %s is nan with seed %d, but must be a number: choose another"
        raise ExperimentError(text % (experiment.places["metrics"], experiment.metrics[0].name, seeds[0]))
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
    """Scores of candidates, larger ones better."""

    def __init__(
        self, mission: Mission, kind: Kind, history: History, engine: Engine, seed: int, progress: Any
    ) -> None:
        """Begin; kind: of the candidates; seed: before the first one; progress: see show_progress()."""
        self._mission, self._kind, self._history, self._engine = mission, kind, history, engine
        self._seed, self._is_first, self._progress, self._best = seed, True, progress, ""

    def __call__(self, genomes: np.ndarray, seeds: range) -> np.ndarray:
        """Return the scores (C, seeds). Raises: ExperimentError, also if the first ones tell no candidates apart."""
        names = ["%08x" % zlib.crc32(genome.tobytes()) for genome in genomes]
        keys = [(name, self._seed + seed) for name in names for seed in seeds]
        scores = self._history.recall(keys)
        for own in self._compute(np.repeat(genomes, len(seeds), axis=0), keys, len(scores), len(seeds)):
            self._history.add(keys[len(scores) : len(scores) + len(own)], own)
            scores += own
            self._progress.set_postfix_str(self._best, refresh=False)
            self._progress.update(len(own))
        values = self._mission.sign * np.array(scores).reshape(len(genomes), len(seeds))
        if self._is_first and len(genomes) > 1 and (values == values[0, 0]).all():
            text = "%s: score is %g in all %d runs of %d controllers: change score or mission, or try a larger --budget"
            place = self._mission.experiment.places["metrics"]
            raise ExperimentError(text % (place, scores[0], len(scores), len(genomes)))
        self._is_first = False
        self._best = "best %.4g" % (self._mission.sign * values.mean(axis=1).max())
        return values

    def _compute(self, genomes: np.ndarray, keys: List[Any], first: int, each: int) -> Iterator[List[float]]:
        """Yield the scores of all runs from the first one on, in their order. Raises: ExperimentError."""
        size = choose_batch(self._mission.experiment, 0)
        size = max(1, min(size, math.ceil((len(keys) - first) / self._engine.workers)))
        ends = range(first + size, len(keys), size) if self._kind.is_stacked else range(0, len(keys), each)
        places = [first, *(end for end in ends if end > first), len(keys)] if first < len(keys) else []
        common, seeds = (self._mission.experiment, hash_suite(), self._kind), [seed for _, seed in keys]
        tasks = [(*common, genomes[a:b], seeds[a:b]) for a, b in zip(places, places[1:])]
        done: Dict[int, List[float]] = {}
        for task, scores in self._engine.compute(score_runs, tasks):
            done[id(task)] = scores
            while tasks and id(tasks[0]) in done:
                yield done.pop(id(tasks.pop(0)))
