"""Program design: controllers for a mission, and what they keep of their score in pseudo-reality.

Pseudo-reality (A. Ligot and M. Birattari, Swarm Intelligence 2019): robots, Wi-Fi and poses that they do not expect.
"""

import argparse
import glob
import os
from typing import Any, Dict, Optional, Sequence

import numpy as np
import yaml

from hero_node.files import hold_file, read_file, write_file
from hero_node.parameters import within
from hero_sim.errors import OptionError
from hero_sim.world import load_arena, read_known

from ..behavior import derive_seed
from ..behaviors import find_behavior
from ..experiments import runner
from ..experiments.computing.batch import load_checked
from ..experiments.computing.code_version import hash_code
from ..experiments.computing.engines import Engine
from ..experiments.computing.progress import show_progress
from ..experiments.errors import ExperimentError
from ..experiments.phantoms import REPLACED
from ..experiments.report import write_report
from ..experiments.results import load
from ..experiments.worlds import USUAL, WORLDS, WORST
from ..machines.machine_file import ENDING, read_controller
from ..machines.modules import draw_dot
from .evaluation import METHODS, Evaluation, History
from .kinds import Kind
from .mission import OWN, Mission, read_mission

FINALISTS, SEEDS = 3, 1_000_000
"""Finalists and seeds of each design; the seeds below are those of the comparison."""


def parse_options(arguments: Optional[Sequence[str]]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="design", description="Design controllers for a mission.")
    parser.add_argument("file", metavar="MISSION.yaml", help="a mission; a .controller is checked and drawn")
    parser.add_argument("--method", choices=METHODS, default="chocolate", help="(%(default)s)")
    parser.add_argument("--budget", type=within(1, SEEDS, int), default=2000, help="runs of each design (%(default)s)")
    parser.add_argument("--designs", type=within(1, 1000, int), default=1, help="independent designs (%(default)s)")
    parser.add_argument("--seed", type=within(0, 2**31 - 1, int), default=1, help="of the designs (%(default)s)")
    parser.add_argument("--tests", type=within(2, 10_000, int), default=10, help="runs of finalists (%(default)s)")
    parser.add_argument("--errors", metavar="FILE", help="pseudo-reality of your robots, a file of fit")
    parser.add_argument("--fresh", action="store_true", help="delete earlier designs of this mission and method")
    runner.add_engine_options(parser)
    return parser.parse_args(arguments)


def main(arguments: Optional[Sequence[str]] = None) -> None:
    """Run the program."""
    options = parse_options(arguments)
    if options.file.endswith(ENDING):
        print(check(options.file))
        return
    plan, _, least = METHODS[options.method]
    if options.budget < least:
        raise ExperimentError("--budget %d: %s needs %d runs or more" % (options.budget, options.method, least))
    mission = read_mission(options.file)
    load_checked(mission.experiment)
    if options.errors:
        read_known(options.errors, ())  # it is used last, perhaps hours later
    kind, folder = plan(mission), f"{os.path.splitext(options.file)[0]}_{options.method}"
    mission.experiment.sources.complete()
    os.makedirs(folder, exist_ok=True)
    with runner.choose_engine(options) as engine:
        for number in range(options.part[0], options.designs + 1, options.part[1]):
            design(options, mission, kind, f"{folder}/design_{number}", engine)
    files = [sorted(glob.glob(f"{folder}/design_{one}_*{kind.ending}")) for one in range(1, options.designs + 1)]
    finalists = [path for own in files for path in own]
    missing = f"{folder}: designs of other parts are still to be made"
    print(compare(options, mission, folder, finalists) if all(files) else missing)


def design(options: Any, mission: Mission, kind: Kind, stem: str, engine: Engine) -> None:
    """Make one design, in files that begin with stem. Raises: ExperimentError."""
    experiment, folder, path = mission.experiment, mission.experiment.folder, stem + ".csv"
    number, own = int(stem.rpartition("_")[2]), {"": repr(mission.content).encode()}
    code = hash_code({**own, **experiment.sources.list_contents(folder, ())})
    about = "%s with %d runs, seed %d, code %s" % (options.method, options.budget, options.seed, code)
    arena = experiment.cells[0].settings.get("arena", "empty")
    arena = os.path.join("..", arena) if os.path.isfile(os.path.join(folder, arena)) else arena
    try:
        with hold_file(path):
            if options.fresh:
                os.truncate(path, 0)
            history = History(path, about)
            with show_progress(options.budget, len(history.runs), path) as progress:
                evaluate = Evaluation(mission, kind, history, engine, number * SEEDS, progress)
                random = np.random.RandomState(derive_seed(options.seed, "design %d" % number))
                found = METHODS[options.method][1](evaluate, kind.genes, options.budget, random)
    except BlockingIOError:
        raise ExperimentError(f"{path}: another program adds to it: wait for its end") from None
    for old in glob.glob(f"{stem}_[1-{FINALISTS}]{kind.ending}") if options.fresh else ():
        os.remove(old)
    # Candidates that differ only in numbers that are not used are one controller.
    contents = dict.fromkeys(kind.dump(genome, arena, f"# Designed by {about}\n") for genome in found)
    for rank, content in enumerate([*contents][:FINALISTS], 1):
        file = f"{stem}_{rank}{kind.ending}"
        if not os.path.exists(file):  # it may have been edited
            write_file(file, content)
            draw(file)


def compare(options: Any, mission: Mission, folder: str, finalists: Sequence[str]) -> str:
    """Run finalists and baseline in the mission's world and in pseudo-reality; return their ranks for users."""
    content, own = mission.content, os.path.dirname(options.file) or "."
    shared = {key: value for key, value in content.items() if key not in OWN}
    shared.update(seeds={"count": options.tests}, metrics=[content["score"]])
    names = [*(os.path.relpath(path, own) for path in finalists), *filter(None, [content.get("baseline")])]
    other = {key: value for key, value in shared.items() if key not in REPLACED and not key.startswith("errors.")}
    worlds: Dict[str, Any] = {"vary": {"behavior": names, "world": [USUAL, WORST]}}
    if options.errors:
        worlds = {**WORLDS[USUAL], "errors": os.path.relpath(options.errors, own), "vary": {"behavior": names}}
    simulated = _run(options, folder + "_simulated", {**shared, "vary": {"behavior": names}})[:, 0]
    pseudo = _run(options, folder + "_pseudo_reality", {**other, **worlds}).mean(axis=1)
    losses = 100.0 * mission.sign * (simulated - pseudo) / np.where(simulated, np.abs(simulated), np.nan)
    order = np.argsort(-mission.sign * pseudo, kind="stable").tolist()
    rows = list(zip(names, simulated, pseudo, losses))
    lines = ["%-50s %10s %14s %6s" % (mission.experiment.metrics[0].name, "simulated", "pseudo-reality", "loss %")]
    lines += ["%-50s %10.4g %14.4g %6.0f" % rows[row] for row in order]
    best = next(finalists[row] for row in order if row < len(finalists))
    return "\n".join([*lines, f"best in pseudo-reality: {draw(best)}"])


def _run(options: argparse.Namespace, stem: str, content: Dict[str, Any]) -> np.ndarray:
    """Run an experiment and write its report; return the medians of its only metric (behaviors, worlds)."""
    path, behaviors = stem + ".yaml", content["vary"]["behavior"]
    files = [os.path.join(os.path.dirname(path), name.partition(":")[0]) for name in behaviors]
    code = hash_code({file: read_file(file) for file in files if os.path.isfile(file)})
    text = f"# Made by design for {code}\n{yaml.safe_dump(content, sort_keys=False)}".encode()
    run = runner.parse_options([path, "--jobs", str(options.jobs)])
    run.executor, run.fresh = options.executor, os.path.exists(path) and read_file(path) != text
    write_file(path, text)
    runner.run_experiment(run)
    write_report(stem)
    (values,) = load(stem).metrics.values()
    medians: np.ndarray = np.median(values, axis=1).reshape(len(behaviors), -1)
    return medians


def check(path: str) -> str:
    """Check all that a controller's file names, and draw it, as draw() does. Raises: ExperimentError, HeroError."""
    try:
        arena = find_behavior(path).arena
        if arena:
            load_arena(arena)
    except (OptionError, ValueError) as error:
        raise ExperimentError(str(error) if path in str(error) else f"{path}: {error}") from None
    return draw(path)


def draw(path: str) -> str:
    """Draw a machine beside its file; return what to do with it. Raises: EntryError for an invalid controller."""
    states = read_controller(path, read_file(path)).states if path.endswith(ENDING) else []
    if states:
        write_file(path + ".dot", draw_dot(states).encode())
    return f"{path}; draw it: dot -Tsvg {path}.dot" if states else path
