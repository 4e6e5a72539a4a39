"""Metrics of users, named FILE.py:FUNCTION: functions of a State that return one number for each world. Pure."""

from typing import Any, Callable, NamedTuple, Optional, Tuple

import numpy as np

from hero_node import shorten, suggest

from ..sources import Sources, load_file
from . import METRICS


class State(NamedTuple):
    """The state of W worlds with N robots each, at one time. All arrays are read-only.

    Attributes:
        time_s: since the start.
        poses: true ones, or on robots measured ones, x m, y m, yaw rad (W, N, 3).
        velocities: how they changed, per second (W, N, 3).
        objects: poses of the objects (W, M, 3).
        radii_m: of the bodies (N,), or one for all.
        arena: walls, areas and lamps.
        sensed: what the behavior sensed: an attribute for each sensor, whose rows are all R = W * N robots.
        memory, colors: what it keeps, and shows (R, 3), or None.
        kept: what metrics keep from one second to the next, by names of their own.
    """

    time_s: float
    poses: np.ndarray
    velocities: np.ndarray
    objects: np.ndarray
    radii_m: Any
    arena: Any = None
    sensed: Any = None
    memory: Any = None
    colors: Optional[np.ndarray] = None
    kept: Any = None

    def by_world(self, values: Any) -> np.ndarray:
        """Return values of all robots (R, ...), as those of sensed and memory are, by world (W, N, ...).

        Raises: ValueError for None, what the behavior does not have.
        """
        if values is None:
            raise ValueError("the behavior keeps no memory, or shows no colors: None has no rows of robots")
        array = np.asarray(values)
        return array.reshape(self.poses.shape[:2] + array.shape[1:])


def list_names(given: Any) -> Tuple[str, ...]:
    """Return the names that a metric may have: of built-in ones, and FILE.py:FUNCTION if given is, or names, some."""
    own = filter(is_own, map(str, given if isinstance(given, dict) else (given,)))
    return (*METRICS, "FILE.py:FUNCTION", *own)


def is_own(name: str) -> bool:
    """Return whether name is of a user's metric: FILE.py:FUNCTION."""
    path, _, function = name.rpartition(":")
    return path.endswith(".py") and function.isidentifier()


def find_own(name: str, sources: Sources) -> Callable[[State], Any]:
    """Return the function of a user's metric. Raises: ValueError if the file, or the function, is missing."""
    path, _, function = name.rpartition(":")
    module = load_file("metric", path, sources)
    metric = getattr(module, function, None)
    if not callable(metric):
        raise ValueError(f"metric {name}: the file has no function {function}{suggest(function, vars(module))}")
    found: Callable[[State], Any] = metric
    return found


def measure_metric(name: str, state: State, sources: Optional[Sources] = None) -> np.ndarray:
    """Return the metric of this name (W,); sources: None reads its file anew.

    Raises: ValueError for a function that is missing, or does not give one number for each world; what it raises.
    """
    if name in METRICS:
        return METRICS[name](state.poses, state.velocities, state.objects, state.radii_m, state.arena)
    metric = find_own(name, sources or Sources())
    name += " (line %d)" % metric.__code__.co_firstlineno if hasattr(metric, "__code__") else ""
    given = metric(state)
    try:
        values = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        raise ValueError(f"metric {name} gives {shorten(given)}, but must give numbers") from None
    worlds = len(state.poses)
    if values.shape != (worlds,):
        text = "metric %s gives an array of shape %s, but must give one number for each of %d worlds (%d,)"
        raise ValueError(text % (name, values.shape, worlds, worlds))
    if np.isnan(values).any():
        raise ValueError("metric %s gives nan at %g s, but must give a number, or inf" % (name, state.time_s))
    return values
