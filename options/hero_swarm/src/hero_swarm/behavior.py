"""Behaviors: a class with sensors, a rate, parameters with units, and step() for one robot or for all.

Pure: numpy only. R robots are the rows of all arrays, world after world.
"""

import math
import zlib
from typing import Any, Dict, Optional, Sequence, Tuple

import numpy as np

from hero_client.values import (
    MAX_LINEAR_M_S,
    NO_OBJECTS,
    Binary,
    Neighborhood,
    Neighbors,
    Objects,
    ObjectsInSight,
    PlacedObjects,
    Sight,
)
from hero_node import shorten
from hero_node.parameters import Parameter, is_number, number

from .sensors import Surroundings, is_sensor, read_sensor
from .sensors.own import Distance, NeighborColors, Odometry, Proximity
from .sensors.virtual import Floor, Light, Pheromone, RangeAndBearing

__all__ = [
    "DRIVES", "PULSES", "VELOCITY", "Behavior", "Binary", "Command", "Distance", "Floor", "Light", "NeighborColors",
    "Neighborhood", "Neighbors", "Objects", "ObjectsInSight", "Odometry", "Pheromone", "Proximity", "Random",
    "RangeAndBearing", "Sensed", "Sight", "act", "decide", "derive_seed", "lock", "sense", "turn",
]  # fmt: skip

MIN_RATE_HZ, MAX_RATE_HZ = 0.1, 100.0

VELOCITY, PULSES = DRIVES = ("velocity", "pulses")

SPEED = number(0.1, 0.01, MAX_LINEAR_M_S, "m/s")
GAIN = number(0.5, 0.0, 5.0, "1/s")
RANGE = number(0.5, 0.05, 5.0, "m")
"""Settings of many behaviors."""

_FIELDS = {
    **dict.fromkeys(("error", "dropout", "loss"), (0.0, 1.0)),
    **dict.fromkeys(("range_m", "field_rad", "half_angle_rad", "range_noise_m", "bearing_noise_rad"), (0.0, math.inf)),
}
"""Least and most of sensors' fields: probabilities; lengths, angles and standard deviations."""

Command = Tuple[Any, Any, Any]
"""linear m/s and angular rad/s, each a number or an array (R,), and the memory for the next step."""

_AHEAD = 16
"""Calls for which uniform numbers are drawn at once: streams are called by world, which takes longer than drawing."""


class Random:
    """Random numbers for all robots: those of a world depend on its seed alone, not on the worlds beside it."""

    def __init__(self, seeds: Sequence[int], robots: int) -> None:
        """Begin one stream for each world with robots."""
        self._streams = [np.random.RandomState(seed) for seed in seeds]
        self._robots, self._drawn = robots, np.empty((len(seeds), 0))

    def random(self, columns: Optional[int] = None) -> np.ndarray:
        """Return numbers from 0 to 1: one for each robot (R,), or several (R, columns)."""
        count = self._robots * (1 if columns is None else columns)
        if self._drawn.shape[1] < count:
            more = [stream.random_sample(_AHEAD * count) for stream in self._streams]
            self._drawn = np.hstack((self._drawn, more))
        drawn, self._drawn = self._drawn[:, :count], self._drawn[:, count:]
        return drawn.reshape(-1) if columns is None else drawn.reshape(-1, columns)

    def normal(self, columns: Optional[int] = None) -> np.ndarray:
        """Return standard normal numbers: one for each robot (R,), or several (R, columns)."""
        shape = (self._robots,) if columns is None else (self._robots, columns)
        return np.concatenate([stream.standard_normal(shape) for stream in self._streams])


def turn(vectors: Any, angle_rad: Any) -> np.ndarray:
    """Return vectors, x and y (2, ...), turned counter-clockwise: by -yaw from the common frame to a robot's own."""
    cosine, sine = np.cos(angle_rad), np.sin(angle_rad)
    return np.array((cosine * vectors[0] - sine * vectors[1], sine * vectors[0] + cosine * vectors[1]))


def lock(values: np.ndarray) -> np.ndarray:
    """Return a read-only view: what a program writes into what it was given would falsify what others read."""
    view = values.view()
    view.flags.writeable = False
    return view


def copy_poses(poses: np.ndarray, shape: Tuple[int, ...]) -> np.ndarray:
    """Return poses (R, 3) of a world as (W, N, 3), read-only, as they lie there: all x, then all y, then all yaws.

    Where yaws lie apart, how numpy rounds their cosines depends on what lies behind them in memory.
    """
    return lock(poses.reshape(shape).copy("K"))


class Sensed:
    """Readings of R robots, as attributes: those below, and one for each sensor of the behavior, by its name.

    All arrays are read-only.
    What a sensor gives, its class says; an array has a row for each robot.

    Attributes:
        time_s: since the behavior began.
        is_known: whether each robot's own pose is known (R,); one whose pose is not known senses nothing.
        poses: x m, y m, yaw rad (R, 3) in the common frame; NaN where it is not known.
        numbers: each robot's number in its world, 0 to N - 1 (R,).
        count: robots in each world, N.
    """

    def __init__(self, time_s: float, poses: np.ndarray, readings: Dict[str, Any]) -> None:
        """Take the poses (W, N, 3) and the readings of all sensors by their names."""
        worlds, self.count, _ = poses.shape
        self.time_s = time_s
        self.poses = lock(poses.reshape(-1, 3).copy("F"))  # see copy_poses()
        self.is_known = lock(np.isfinite(self.poses[:, 0] + self.poses[:, 1] + self.poses[:, 2]))
        self.numbers = lock(np.tile(np.arange(self.count), worlds))
        self._readings = {
            name: type(reading)(*map(lock, reading)) if isinstance(reading, tuple) else lock(reading)
            for name, reading in readings.items()
        }

    def __getattr__(self, name: str) -> Any:
        try:
            return self.__dict__["_readings"][name]
        except KeyError:
            raise AttributeError(f"the behavior has no sensor {name!r}") from None


class Behavior:
    """One behavior; subclasses say what it senses and does. Instances may set other parameters: Milling(rate_hz=10).

    Attributes:
        rate_hz: steps per second.
        metric: name of the metric (hero_swarm.metrics) that shows how well it does.
        drive: how its speeds reach the wheels: "velocity", the firmware's velocity controller, or "pulses", servo
            pulses, which wheels follow sooner (see wheel_pulses) and which robots with calibrated motors take.
        arena: of its virtual sensors, where the program is given none: a name or file of the simulator.
        settings: those of its numbers that pages may set, with limits and units; the numbers are the defaults.
    """

    rate_hz: float = 20.0
    metric: str = "dispersion_ratio"
    drive: str = VELOCITY
    arena: str = ""
    settings: Dict[str, Parameter] = {}

    def __init__(self, **parameters: Any) -> None:
        """Set parameters by name, and fields of sensors by SENSOR.FIELD.

        Raises: TypeError for one that the behavior does not have; ValueError for rate_hz, drive, or a sensor's field.
        """
        for name, value in parameters.items():
            sensor, dot, field = name.partition(".")
            if dot and name in self.numbers():
                least, most = _FIELDS.get(field, (-math.inf, math.inf))
                if not (isinstance(value, (int, float)) and least <= value <= most):
                    text = "%s: %s is %r, but must be a number from %g to %g"
                    raise ValueError(text % (type(self).__name__, name, value, least, most))
                setattr(self, sensor, getattr(self, sensor)._replace(**{field: value}))
                continue
            if name.startswith("_") or not hasattr(self, name) or callable(getattr(self, name)):
                raise TypeError(f"{type(self).__name__} has no parameter {name!r}; it has {self.parameters()}")
            setattr(self, name, value)
        if not is_number(self.rate_hz, MIN_RATE_HZ, MAX_RATE_HZ):
            text = "%s: rate_hz is %r, but must be a number from %g to %g"
            raise ValueError(text % (type(self).__name__, self.rate_hz, MIN_RATE_HZ, MAX_RATE_HZ))
        if self.drive not in DRIVES:
            raise ValueError(f"{type(self).__name__}: drive is {self.drive!r}, but must be {' or '.join(DRIVES)}")

    def parameters(self) -> Dict[str, Any]:
        """Return all parameters and sensors with their values."""
        names = [name for name in dir(self) if not name.startswith("_") and name != "settings"]
        return {name: getattr(self, name) for name in names if not callable(getattr(self, name))}

    def numbers(self) -> Dict[str, float]:
        """Return the parameters and the fields of sensors, as SENSOR.FIELD, that are numbers, with their values."""
        own = {f"{name}.{field}": getattr(sensor, field) for name, sensor in self.sensors().items()
               for field in sensor._fields}  # fmt: skip
        given = {**self.parameters(), **own}
        return {name: value for name, value in given.items() if isinstance(value, (int, float))}

    def sensors(self) -> Dict[str, Any]:
        """Return the sensors by name."""
        return {name: value for name, value in self.parameters().items() if is_sensor(value)}

    def step(self, sensed: Sensed, memory: Any, random: Random) -> Command:
        """Return the commands of all robots and what to remember; memory is None in the first step."""
        raise NotImplementedError

    def colors(self, memory: Any) -> Optional[np.ndarray]:
        """Return the color that each robot shows, red green blue from 0 to 1 (R, 3), or None."""
        return None

    def messages(self, memory: Any) -> Optional[np.ndarray]:
        """Return what each robot sends to RangeAndBearing sensors, one number (R,) or several (R, K), or None."""
        return None

    def deposits(self, memory: Any) -> Optional[np.ndarray]:
        """Return how much pheromone each robot leaves where it is, per second (R,), or None."""
        return None


def sense(
    behavior: Behavior, time_s: float, poses: np.ndarray, random: Any, things: PlacedObjects = NO_OBJECTS, **around: Any
) -> Sensed:
    """Return what the sensors of a behavior tell about things and poses (W, N, 3), NaN for unknown ones.

    around: other fields of Surroundings; kept: what each sensor keeps, by its name.
    Raises: ValueError for a sensor that gives no arrays of robots; whatever a sensor raises.
    """
    kept = around.pop("kept", {})
    common = Surroundings(time_s, poses, random, things, **around)
    names = list(kept or behavior.sensors())  # to look for them again in each step would take long
    readings = {
        name: read_sensor(name, getattr(behavior, name), common._replace(kept=kept.setdefault(name, {})))
        for name in names
    }
    return Sensed(time_s, poses, readings)


def decide(behavior: Behavior, sensed: Sensed, memory: Any, random: Random) -> Tuple[np.ndarray, np.ndarray, Any]:
    """Return linear m/s and angular rad/s of all robots (R,), and the memory, as the behavior's step() gives them.

    Raises: ValueError for other shapes, and for a step that writes into what it senses.
    """
    robots = len(sensed.numbers)
    try:
        command = behavior.step(sensed, memory, random)
    except ValueError as error:
        if "read-only" not in str(error):
            raise
        text = "%s.step() writes into an array of sensed, which is read-only: copy it first, as in sensed.poses.copy()"
        # With the traceback of the line that writes.
        raise ValueError(text % type(behavior).__name__).with_traceback(error.__traceback__) from None
    if not isinstance(command, tuple) or len(command) != 3:
        text = "%s.step() must return linear_m_s, angular_rad_s, memory, not %s"
        raise ValueError(text % (type(behavior).__name__, shorten(command)))
    speeds = []
    for name, values in zip(("linear_m_s", "angular_rad_s"), command):
        if np.shape(values) not in ((), (robots,)) or np.asarray(values).dtype.kind not in "bif":
            given = shorten(values) if np.shape(values) in ((), (robots,)) else f"of shape {np.shape(values)}"
            text = "%s.step() gives %s %s: it must be a number, or one for each of %d robots (%d,)"
            raise ValueError(text % (type(behavior).__name__, name, given, robots, robots))
        speeds.append(np.broadcast_to(np.asarray(values, float), robots))
    return speeds[0], speeds[1], command[2]


def act(behavior: Behavior, memory: Any, robots: int) -> Dict[str, Optional[np.ndarray]]:
    """Return colors, messages and deposits of all robots, by these names. Raises: ValueError for other shapes."""
    acts: Dict[str, Optional[np.ndarray]] = {}
    for name, columns in (("colors", (3,)), ("messages", None), ("deposits", ())):
        given = acts[name] = getattr(behavior, name)(memory)
        shape = np.shape(given)
        if given is not None and (shape[:1] != (robots,) or (columns is not None and shape[1:] != columns)):
            text = "%s.%s() gives an array of shape %s: it must have a row for each of %d robots (%s)"
            wanted = ", ".join(map(str, (robots, *(columns or ()))))
            raise ValueError(text % (type(behavior).__name__, name, shape, robots, wanted))
    return acts


def derive_seed(seed: int, purpose: str) -> int:
    """Return a seed for another stream of random numbers of the same world."""
    return zlib.crc32(("%d %s" % (seed, purpose)).encode())
