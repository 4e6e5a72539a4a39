"""The setup of a cell, loaded once: what all its runs share, in the simulator and on robots."""

import os
from contextlib import contextmanager
from typing import Iterable, Iterator, NamedTuple, Sequence

import numpy as np

from hero_node import HeroError, suggest
from hero_sim.world import Arena, load_arena, read_known

from ...behavior import Behavior, Objects
from ...behaviors import find_behavior
from ...metrics.own import find_own
from ...trial import OPEN, Trial, scatter_objects
from ..errors import ExperimentError
from ..experiment_file import ERROR_KEYS, ERRORS, NOT_PARAMETERS, POINT, Cell, Experiment
from .starts import place_all


class CellSetup(NamedTuple):
    """A cell with its behavior and arena; without an arena, an open plane."""

    experiment: Experiment
    cell: Cell
    behavior: Behavior
    arena: Arena

    def place_robots(self, seeds: Sequence[int]) -> np.ndarray:
        """Return where the robots of runs begin (W, N, 3). Raises: ExperimentError."""
        experiment, cell, arena = self.experiment, self.cell, self.arena
        start = cell.start._replace(file=experiment.list_files(cell).get("file"))
        if cell.settings.get("objects", "arena") != "arena":
            arena = arena._replace(objects=())  # they are placed clear of the robots
        with _at(experiment, "start"):
            return place_all(start, arena, cell.settings["robots"], seeds, experiment.sources.read)

    def build_trial(self, seeds: Sequence[int]) -> Trial:
        """Return worlds with these seeds, at their start. Raises: ExperimentError with the line of what is wrong."""
        experiment, settings = self.experiment, self.cell.settings
        starts = self.place_robots(seeds)
        objects = None  # as they are in the arena
        with _at(experiment, "objects"):
            if settings.get("objects", "arena") != "arena":
                objects = [scatter_objects(self.arena, poses, seed) for poses, seed in zip(starts, seeds)]
        with _at(experiment, "errors"):
            file = experiment.list_files(self.cell).get("errors")
            known = read_known(file, range(settings["robots"]), experiment.sources.read) if file else []
            known += ["%s=%r" % (name.partition(".")[2], settings[name]) for name in ERROR_KEYS if name in settings]
            delay_s, wifi = settings.get("delay_s", 0.0), settings.get("wifi", "ideal")
            scale = settings.get("errors", "default")  # a number, or a name; a file is put over usual differences
            scale = ERRORS.get(scale, ERRORS["default"]) if isinstance(scale, str) else scale
            return Trial(
                self.behavior, self.arena, settings["robots"], seeds, starts=starts, objects=objects,
                errors=scale, known_errors=known, delay_s=delay_s, wifi=wifi, is_point=settings.get("body") == POINT,
            )  # fmt: skip


def set_up(experiment: Experiment, cell: Cell) -> CellSetup:
    """Load the behavior and the arena of a cell. Raises: ExperimentError with the line of what cannot be used."""
    files, sources = experiment.list_files(cell), experiment.sources
    for name, path in files.items():
        if not sources.find(path) and not os.path.exists(path):
            text = "%s: %s %s cannot be read: no such file; paths are relative to the experiment's file, or absolute"
            raise ExperimentError(text % (experiment.places[name], name, path))
    with _at(experiment, "behavior"):
        kind = find_behavior(experiment.locate(cell.behavior), sources)
        known = kind().numbers()
    own = {name: value for name, value in cell.parameters.items() if name in known}
    for name, value in own.items():
        with _at(experiment, name):
            kind(**{name: value})
    with _at(experiment, "behavior"):
        behavior = kind(**own)
    with _at(experiment, "arena"):
        chosen = cell.settings.get("arena")
        file = (files["arena"], sources.read) if "arena" in files else (chosen,)
        arena: Arena = OPEN if chosen is None else sources.load(f"arena {chosen}", lambda: load_arena(*file))
        pushes = any(isinstance(sensor, Objects) for sensor in behavior.sensors().values())
        if pushes and not arena.objects:
            raise ExperimentError(f"{cell.behavior} pushes objects: arena must have them, as box does")
    return CellSetup(experiment, cell, behavior, arena)


def check_setup(experiment: Experiment, own_metrics: Iterable[str]) -> None:
    """Check that behaviors have their own parameters, one of them each of the others, and that there are own metrics.

    Raises: ExperimentError.
    """
    with _at(experiment, "metrics"):
        for name in own_metrics:
            find_own(experiment.locate(name), experiment.sources)
    with _at(experiment, "behavior"):
        # Where behaviors vary, a baseline need not have what the others have.
        has = {
            name: list(find_behavior(experiment.locate(name), experiment.sources)().numbers())
            for name in experiment.list_behaviors()
        }
    every = list(dict.fromkeys(name for names in has.values() for name in names))
    for cell in experiment.cells:
        for name in cell.parameters:
            whose, known = (cell.behavior, has[cell.behavior]) if name in cell.own else (experiment.behavior, every)
            if name not in known:
                hint = suggest(name, (*known, *NOT_PARAMETERS))
                text = "%s: %s has no parameter %r; there are %s%s"
                raise ExperimentError(text % (experiment.places[name], whose, name, ", ".join(known), hint))


@contextmanager
def _at(experiment: Experiment, name: str) -> Iterator[None]:
    """Name the line of what is wrong; what is not in the file is the behavior's need."""
    try:
        yield
    except (HeroError, TypeError, ValueError) as error:
        place = experiment.places.get(name, experiment.places["behavior"])
        raise ExperimentError(f"{place}: {error}") from error
