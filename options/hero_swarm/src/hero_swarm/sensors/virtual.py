"""Sensors that HeRo lacks, computed from poses: the same in steps, behind sockets and on robots. Pure.

The idea is that of augmented reality for Kilobots (A. Reina et al., ARK, IEEE RA-L 2017). Walls shade nothing.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from hero_client.values import Neighbors, sense_neighbors
from hero_sim.world import BARE_GRAY, Arena

from . import Surroundings

MAX_CELLS = 1_000_000
"""Cells of a field of pheromone in all worlds."""


def _find_arena(around: Surroundings, sensor: Any) -> Arena:
    if around.arena is None:
        raise ValueError(f"{type(sensor).__name__} needs an arena: give arena:=FILE")
    return around.arena


class Ground(NamedTuple):
    """The floor below each robot.

    Attributes:
        gray: from 0, black, to 1, white (R,); nan for robots without a pose.
        color: red green blue from 0 to 1 (R, 3).
        area: number of the area in the arena's file, of several the last one; -1: none (R,).
    """

    gray: np.ndarray
    color: np.ndarray
    area: np.ndarray


class Floor(NamedTuple):
    """A sensor of the arena's areas below the robot; gives a Ground."""

    ahead_m: float = 0.0
    """Place of the sensor before the center."""

    def read(self, around: Surroundings) -> Ground:
        """Return what lies below."""
        x_m, y_m = _look_ahead(around.poses, self.ahead_m, 0.0)
        color = np.full((len(x_m), 3), BARE_GRAY)
        area = np.full(len(x_m), -1)
        for number, place in enumerate(_find_arena(around, self).areas):
            inside = place.covers(x_m, y_m)
            color[inside], area[inside] = place.find_colors(x_m[inside], y_m[inside]), number
        color[~np.isfinite(x_m)] = np.nan
        return Ground(color.mean(axis=1), color, area)


def _look_ahead(poses: np.ndarray, distance_m: float, angle_rad: float) -> Any:
    """Return x m and y m (R,) of points at this distance and bearing from the robots."""
    x_m, y_m, yaw_rad = poses.reshape(-1, 3).T
    return x_m + distance_m * np.cos(yaw_rad + angle_rad), y_m + distance_m * np.sin(yaw_rad + angle_rad)


class Brightness(NamedTuple):
    """Light of all lamps: its strength, 1 at a lamp, and bearing of the sum of directions, rad (R,); nan: no pose."""

    intensity: np.ndarray
    bearing_rad: np.ndarray


class Light(NamedTuple):
    """A sensor of the arena's lamps; gives a Brightness."""

    reach_m: float = 1.0
    """Distance at which the light of a lamp is half as strong."""

    def read(self, around: Surroundings) -> Brightness:
        """Return the light at each robot."""
        lamps_m = _find_arena(around, self).lamps_m
        x_m, y_m, yaw_rad = around.poses.reshape(-1, 3).T[..., None]
        to_x_m, to_y_m = lamps_m[:, 0] - x_m, lamps_m[:, 1] - y_m
        distance_m = np.hypot(to_x_m, to_y_m)
        strength = 1.0 / (1.0 + (distance_m / self.reach_m) ** 2)
        bearing_rad = np.arctan2(to_y_m, to_x_m) - yaw_rad
        ahead, left = (strength * np.cos(bearing_rad)).sum(axis=1), (strength * np.sin(bearing_rad)).sum(axis=1)
        intensity = strength.sum(axis=1) + 0.0 * x_m[:, 0]
        return Brightness(intensity, np.arctan2(left, ahead) + 0.0 * intensity)


class Messages(NamedTuple):
    """Messages that neighbors sent in the last step; columns are the robots of the same world.

    Attributes:
        seen: from which robots a message came (R, N); the other arrays are 0 where none did.
        range_m, bearing_rad: where from (R, N).
        data: what they sent (R, N, K).
    """

    seen: np.ndarray
    range_m: np.ndarray
    bearing_rad: np.ndarray
    data: np.ndarray


class RangeAndBearing(NamedTuple):
    """Messages between neighbors, which the behavior's messages() sends; gives Messages."""

    range_m: float = 0.5
    loss: float = 0.0
    """Probability that a message is lost."""
    rate_hz: float = math.inf
    """Messages come at most this often."""

    def read(self, around: Surroundings) -> Messages:
        """Return the messages that arrive now."""
        near = sense_neighbors(around.poses, Neighbors(range_m=self.range_m, dropout=self.loss), around.random)
        due_s = around.kept.get("due_s", -math.inf)
        comes = around.messages is not None and around.time_s >= due_s - 1e-6
        if comes:
            around.kept["due_s"] = around.time_s + 1.0 / self.rate_hz
        seen = near.seen & comes
        sent = np.zeros(len(seen)) if around.messages is None else np.asarray(around.messages, dtype=float)
        data = sent.reshape(len(seen), -1)[near.rows] * seen[..., None]
        return Messages(seen, near.range_m * seen, near.bearing_rad * seen, data)


class Trail(NamedTuple):
    """Pheromone at the robot's center, and before it to the left and right (R,); nan for robots without a pose."""

    here: np.ndarray
    left: np.ndarray
    right: np.ndarray


class Pheromone(NamedTuple):
    """A field over the arena that the behavior's deposits() adds to, and that evaporates; gives a Trail."""

    half_life_s: float = 30.0
    cell_m: float = 0.04
    reach_m: float = 0.06
    angle_rad: float = 0.6
    """Place of the antennas: distance from the center, and bearing to each side."""

    def read(self, around: Surroundings) -> Trail:
        """Evaporate the field, add what robots deposited since the last step, and return what they sense."""
        field, last_s = self._find_field(around), around.kept.get("time_s", around.time_s)
        around.kept["time_s"] = around.time_s
        field *= 0.5 ** ((around.time_s - last_s) / self.half_life_s)
        if around.deposits is not None:
            cells, is_inside = self._find(field, around, 0.0, 0.0)
            amounts = np.asarray(around.deposits, dtype=float)[is_inside] * (around.time_s - last_s)
            np.add.at(field, tuple(cells[:, is_inside]), amounts)
        places = ((0.0, 0.0), (self.reach_m, self.angle_rad), (self.reach_m, -self.angle_rad))
        return Trail(*(self._sample(field, around, *place) for place in places))

    def _find_field(self, around: Surroundings) -> np.ndarray:
        """Return the field (W, rows, columns), empty in the first step."""
        if "field" not in around.kept:
            low_m, high_m = _find_arena(around, self).bounds_m.reshape(2, 2)
            columns, rows = np.ceil((high_m - low_m) / self.cell_m).astype(int).tolist()
            if len(around.poses) * rows * columns > MAX_CELLS:
                text = "Pheromone: %d x %d cells of %g m in %d worlds are more than %d: take a smaller arena or batch"
                raise ValueError(text % (rows, columns, self.cell_m, len(around.poses), MAX_CELLS))
            around.kept["field"] = np.zeros((len(around.poses), rows, columns))
        field: np.ndarray = around.kept["field"]
        return field

    def _find(self, field: np.ndarray, around: Surroundings, distance_m: float, angle_rad: float) -> Any:
        """Return world, row and column of places before robots (3, R), and which lie in the field (R,)."""
        x_m, y_m = _look_ahead(around.poses, distance_m, angle_rad)
        low_m = _find_arena(around, self).bounds_m[:2]
        with np.errstate(invalid="ignore"):
            row, column = (np.floor((values - low) / self.cell_m) for values, low in ((y_m, low_m[1]), (x_m, low_m[0])))
            is_inside = (row >= 0) & (row < field.shape[1]) & (column >= 0) & (column < field.shape[2])
        worlds = np.repeat(np.arange(len(around.poses)), around.poses.shape[1])
        return np.where(is_inside, (worlds, row, column), 0).astype(int), is_inside

    def _sample(self, field: np.ndarray, around: Surroundings, distance_m: float, angle_rad: float) -> np.ndarray:
        cells, is_inside = self._find(field, around, distance_m, angle_rad)
        return np.where(is_inside, field[tuple(cells)], 0.0) + 0.0 * around.poses.reshape(-1, 3)[:, 0]
