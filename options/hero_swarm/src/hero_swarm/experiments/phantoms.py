"""Program phantoms: would a result survive outside the world in which it was found?

Runs an experiment, or a behavior, in the nominal world, with each assumption by itself, and with all of them
(worlds.py), and says which one takes most. It writes an ordinary experiment file, NAME_phantoms.yaml, and its report.
"""

import argparse
import math
import os
from typing import Any, Dict, Mapping, Optional, Sequence

import numpy as np
import yaml

from hero_node import HeroError
from hero_node.files import write_file
from hero_node.parameters import within

from ..behaviors import find_behavior
from ..metrics import CHANCE, score
from . import runner
from .errors import ExperimentError
from .experiment_file import Experiment, Metric, read_experiment
from .report import write_report
from .results import load
from .worlds import NOMINAL, USUAL, WORLDS, WORST

REPLACED = {"world", *(name for settings in WORLDS.values() for name in settings)}
"""Settings that the worlds give."""

_FIRST_LINE = "# Made by `rosrun hero_swarm phantoms %s`, and made anew by it.\n"


def parse_options(arguments: Optional[Sequence[str]]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="phantoms", description="Score a result in worlds with other assumptions.")
    add, cores = parser.add_argument, os.cpu_count() or 1
    add("what", metavar="EXPERIMENT.yaml|BEHAVIOR", help="an experiment's file, or a behavior as in one")
    add("--seeds", type=within(2, 10_000, int), default=10, help="runs of each cell (%(default)s)")
    add("--robots", type=within(1, 1000, int), default=20, help="of a behavior (%(default)s)")
    add("--time", type=within(1.0, 86_400.0), default=120.0, metavar="S", help="of a run (%(default)s)")
    add("--arena", help="of a behavior: empty, box, ... or a file (an open plane)")
    add("--jobs", type=within(1, 1024, int), default=cores, help="processes (%(default)s)")
    add("--fresh", action="store_true", help="compute all runs anew")
    return parser.parse_args(arguments)


def make_file(options: argparse.Namespace) -> str:
    """Write the experiment in all worlds, and return the file's name. Raises: ExperimentError."""
    if options.what.endswith((".yaml", ".yml")):
        text, _ = read_experiment(options.what)
        content, stem = yaml.safe_load(text), os.path.splitext(options.what)[0]
    else:
        try:
            metric = find_behavior(options.what).metric
        except (HeroError, TypeError, ValueError) as error:
            raise ExperimentError(str(error)) from error
        content = {"behavior": options.what, "robots": options.robots, "time_s": options.time, "metrics": [metric]}
        if options.arena:
            content["arena"] = options.arena
        content["start"] = {"kind": "uniform", "cover": 0.02, "gap_m": 0.0}
        stem = os.path.splitext(os.path.basename(options.what.replace(":", "_")))[0]
    path = stem + runner.IN_WORLDS + ".yaml"
    first = _FIRST_LINE % options.what
    if os.path.exists(path):
        with open(path, encoding="utf-8") as file:
            if file.readline() != first:
                raise ExperimentError(f"{path} is there, and was not made by this command: move it away")
    write_file(path, (first + yaml.safe_dump(_put_in_worlds(content, options.seeds), sort_keys=False)).encode())
    return path


def _put_in_worlds(content: Dict[str, Any], seeds: int) -> Dict[str, Any]:
    """Return an experiment in which the world varies, in place of all that a world gives."""
    kept = {name: value for name, value in content.items() if name not in REPLACED and not name.startswith("errors.")}
    varied = {name: value for name, value in kept.pop("vary", {}).items() if name not in REPLACED}
    kept["vary"] = {"world": list(WORLDS), **{name: v for name, v in varied.items() if not name.startswith("errors.")}}
    kept["seeds"] = {**kept.get("seeds", {}), "count": seeds}
    kept.pop("record", None)
    kept.pop("compare", None)
    return kept


def find_shares(experiment: Experiment, values: np.ndarray) -> Dict[str, float]:
    """Return which share of the nominal score each world keeps, over all cells: medians of the first metric.

    values: the first metric (cells, seeds), which counts above chance where that is known (metrics.score). nan where
    the nominal score is zero, infinite or missing.
    """
    metric = experiment.metrics[0]
    if _has_chance(metric):
        values = score(metric.source, values)
    worlds = np.array([cell.varied["world"] for cell in experiment.cells])
    medians = {world: float(np.nanmedian(values[worlds == world])) for world in WORLDS}
    shares = {}
    for world, own in medians.items():
        part, whole = (medians[NOMINAL], own) if metric.falls else (own, medians[NOMINAL])
        shares[world] = max(0.0, part / whole) if math.isfinite(part) and whole else math.nan
    return shares


def _has_chance(metric: Metric) -> bool:
    return metric.bound is None and metric.source in CHANCE


def describe(shares: Mapping[str, float], metric: Metric) -> str:
    """Return the verdict for users: a line for each world, and which assumption takes most."""
    above, zero = (" above chance", "not above chance") if _has_chance(metric) else ("", "zero")
    lines = [f"share of the nominal {metric.name}{above} that is kept"]
    lines += [f"  {world:16} {'no score' if math.isnan(own) else f'{own:.2f}'}" for world, own in shares.items()]
    if math.isnan(shares[USUAL]):
        return "\n".join([*lines, f"no verdict: the nominal score is {zero}, or never reached"])
    single = {world: share for world, share in shares.items() if world not in (NOMINAL, USUAL, WORST)}
    weakest = min(single, key=lambda world: single[world] if math.isfinite(single[world]) else math.inf)
    lines.append(f"usual robots keep {shares[USUAL]:.2f}; most is lost by {weakest} ({single[weakest]:.2f})")
    return "\n".join(lines)


def main(arguments: Optional[Sequence[str]] = None) -> None:
    """Run the program."""
    options = parse_options(arguments)
    path = make_file(options)
    folder = os.path.splitext(path)[0]
    _, experiment = read_experiment(path)
    fresh = ["--fresh"] if options.fresh else []
    print(runner.run_experiment(runner.parse_options([path, "--jobs", str(options.jobs), *fresh])))
    write_report(folder)
    metric = experiment.metrics[0]
    print(describe(find_shares(experiment, load(folder).metrics[metric.name]), metric))
