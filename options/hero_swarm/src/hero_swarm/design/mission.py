"""The file of a mission: an experiment without seeds and metrics, but with a score. Pure.

robots: 20
arena: black_spot_arena.yaml
time_s: 120
score: {mean_of_last_s: {scores.py:robots_on_black: 120}}
baseline: black_spot.controller
"""

import os
from typing import Any, Dict, NamedTuple

from hero_node.files import Entry, EntryError, load_entries, mark_values

from ..behaviors import find_behavior
from ..experiments.errors import ExperimentError
from ..experiments.experiment_file import ERROR_KEYS, SETTINGS, Experiment, check_experiment
from ..sources import Sources

OWN = ("score", "baseline", "behavior", "ranges")
"""Keys that the experiments of a design do not take over."""

_EXAMPLE = "score: {mean_of_last_s: {FILE.py:FUNCTION: 60}}"


class Mission(NamedTuple):
    """A file that has been checked.

    Attributes:
        experiment: with one cell, and the score as its only metric.
        content: of the file; baseline: a behavior; ranges: limits of the numbers of the behavior that are designed.
        sign: 1 if the best score is the largest one, -1 if it is the smallest.
    """

    experiment: Experiment
    content: Dict[str, Any]
    sign: float


def read_mission(path: str) -> Mission:
    """Return the mission of a file. Raises: ExperimentError with file and line."""
    try:
        root = load_entries(path, _EXAMPLE)
        given = root.mapping((*OWN, *SETTINGS, *ERROR_KEYS, "world", "start", "time_s"))
        if "score" not in given:
            raise ExperimentError(f"{path}: score is missing: give what shall be best, such as {_EXAMPLE}")
        for limits in given["ranges"].mapping().values() if "ranges" in given else ():
            low, high = limits.numbers(2, -1e6, 1e6, "two numbers")
            if low >= high:
                limits.refuse("the lower limit before the higher one")
        others = mark_values({"behavior": "aggregation", "seeds": {"count": 1}}, path).mapping()
        kept = {name: entry for name, entry in given.items() if name not in ("score", "baseline", "ranges")}
        metrics = Entry([given["score"]], "score", given["score"].place)
        entry = Entry({**others, **kept, "metrics": metrics}, "", root.place)
        experiment = check_experiment(entry, os.path.abspath(os.path.dirname(path)), Sources())
        if "baseline" in given:
            try:  # it runs last, perhaps hours later
                find_behavior(experiment.locate(given["baseline"].text()))
            except ValueError as error:
                raise ExperimentError(f"{given['baseline'].place}: baseline: {error}") from None
        return Mission(experiment, root.plain(), -1.0 if experiment.metrics[0].falls else 1.0)
    except EntryError as error:
        raise ExperimentError(str(error)) from None
