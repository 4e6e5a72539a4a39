"""Sensors of behaviors: named tuples of their limits, which read() turns into arrays with a row per robot. Pure.

A sensor of a user is a named tuple with read(around), which returns an array (R, ...) or a named tuple of arrays.
"""

from typing import Any, Callable, Dict, NamedTuple, Optional

import numpy as np

from hero_client.values import (
    NO_OBJECTS,
    Binary,
    Neighbors,
    Objects,
    PlacedObjects,
    Sight,
    sense_binary,
    sense_neighbors,
    sense_objects,
    sense_sight,
)
from hero_sim.world import Arena, compile_loops

from . import pair_loops


class Surroundings(NamedTuple):
    """All that sensors may read. R robots are the rows of W worlds with N robots each, world after world.

    Attributes:
        time_s: since the behavior began.
        poses: x m, y m, yaw rad in the common frame (W, N, 3), NaN for a robot whose pose is not known.
        random: the behavior's random numbers.
        things: objects.
        arena: with its areas and lamps; None where it is not known.
        robots: own readings of the robots as attributes, named as those of RobotRows; None without any.
        colors: of robots since the last step, red green blue from 0 to 1 (R, 3); None: dark.
        messages: what robots sent in the last step (R,) or (R, K); None: nothing.
        deposits: pheromone that robots leave since the last step, per second (R,); None: nothing.
        kept: what the sensor keeps from step to step.
    """

    time_s: float
    poses: np.ndarray
    random: Any
    things: PlacedObjects = NO_OBJECTS
    arena: Optional[Arena] = None
    robots: Any = None
    colors: Optional[np.ndarray] = None
    messages: Optional[np.ndarray] = None
    deposits: Optional[np.ndarray] = None
    kept: Dict[str, Any] = {}


def _compile(name: str, around: Surroundings) -> Any:
    """Return a loop over pairs of robots, or None where it is not compiled."""
    loops = compile_loops(pair_loops, around.poses.shape[0] * around.poses.shape[1])
    return loops and getattr(loops, name)


_READERS: Dict[type, Callable[[Any, Surroundings], Any]] = {
    Binary: lambda sensor, around: sense_binary(around.poses, sensor, around.random, _compile("find_touched", around)),
    Neighbors: lambda sensor, around: sense_neighbors(
        around.poses, sensor, around.random, _compile("find_near", around)
    ),
    Objects: lambda sensor, around: sense_objects(around.poses, around.things, sensor),
    Sight: lambda sensor, around: sense_sight(around.poses, around.things, sensor),
}


def is_sensor(value: Any) -> bool:
    """Return whether a value is a sensor."""
    return isinstance(value, tuple) and (type(value) in _READERS or callable(getattr(value, "read", None)))


def read_sensor(name: str, sensor: Any, around: Surroundings) -> Any:
    """Return what a sensor gives, an array (R, ...) or a named tuple of arrays.

    Raises: ValueError with its name for anything else, or whatever it raises.
    """
    reader = _READERS.get(type(sensor))
    reading = sensor.read(around) if reader is None else reader(sensor, around)
    robots = around.poses.shape[0] * around.poses.shape[1]
    arrays = reading if isinstance(reading, tuple) else (reading,)
    wrong = [array for array in arrays if not isinstance(array, np.ndarray) or array.dtype.kind not in "bif"]
    if wrong or (not isinstance(reading, tuple) and reading.shape[:1] != (robots,)):
        given = f"shape {reading.shape}" if not wrong else repr(wrong[0])[:60]
        text = "sensor %s gives %s: read() must return an array of numbers with a row for each of %d robots"
        raise ValueError(text % (name, given, robots))
    return reading
