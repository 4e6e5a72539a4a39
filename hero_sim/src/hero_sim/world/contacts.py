"""Bodies that touch walls, obstacles or each other, and how they get apart.

Pure: numpy only, over all robots of all worlds at once; robots of different worlds never meet.
"""

from typing import Any, Tuple

import numpy as np

from ..robot_constants import BODY_RADIUS_M
from .arena import Arena, list_obstacles, measure_clearance

__all__ = ["Contacts"]

_PASSES = 4
_TOUCH_M = 1e-9
_OVERLAP_M = 1e-6

_MARGIN_M = 0.03
"""How far bodies may move until it is looked up anew who is near whom; more takes longer at each step."""


class Contacts:
    """Keeps all bodies of worlds with the same arena apart. Positions are arrays (2, R), x and y (m), world by world.

    Only those that are near each other are compared. These are listed again before any other could touch, so what
    happens does not depend on when.
    """

    def __init__(self, arena: Arena, worlds: int, rows: int) -> None:
        """Expect so many rows, spread evenly over the worlds."""
        self._arena = arena
        self._shape = (worlds, rows // worlds)
        # Of each two robots the earlier one is the first.
        self._ordered = np.triu(np.ones((self._shape[1], self._shape[1]), dtype=bool), k=1)
        self._obstacles, radii_m = list_obstacles(arena)
        self._free_m = radii_m + BODY_RADIUS_M
        self._reach_m = -np.inf  # how far all may still move until the lists are incomplete
        # Two robots that are near each other; a robot, an obstacle near it, and how far away its center has to be.
        self._firsts = self._seconds = self._beside = np.empty(0, dtype=int)
        self._near, self._near_free_m = self._obstacles, self._free_m

    def separate(self, positions_m: np.ndarray, before_m: np.ndarray, moved_m: float) -> None:
        """Push bodies out of walls, obstacles and each other; those that cannot get free return to before_m.

        moved_m: how far the fastest has moved since the last call.
        """
        self._reach_m -= moved_m
        for _ in range(_PASSES):
            pushed_apart, pushed_out = self._push_apart(positions_m), self._push_out(positions_m)
            if not len(pushed_apart) and not len(pushed_out):
                return
        pressed = np.zeros(self._shape, dtype=bool)
        pressed[np.concatenate((pushed_apart, pushed_out)) // self._shape[1]] = True
        # Whatever still overlaps goes back to where it was free; that may block another, so look again.
        while True:
            stuck = pressed.ravel() & self.find_overlaps(positions_m) & (positions_m != before_m).any(axis=0)
            if not stuck.any():
                return
            positions_m[:, stuck] = before_m[:, stuck]
            self._reach_m = -np.inf

    def find_overlaps(self, positions_m: np.ndarray) -> np.ndarray:
        """Return which robots (R,) reach more than 1 um into a wall, an obstacle or another robot."""
        overlaps = measure_clearance(positions_m.T, self._arena) < BODY_RADIUS_M - _OVERLAP_M
        for rows in self._find_pairs(positions_m, 2.0 * BODY_RADIUS_M - _OVERLAP_M):
            overlaps[rows] = True
        return overlaps

    def _find_pairs(self, positions_m: np.ndarray, distance_m: float) -> Tuple[np.ndarray, np.ndarray]:
        """Return the rows of the first and the second of all two robots less than distance_m apart."""
        x_m, y_m = positions_m.reshape(2, *self._shape)
        apart_x_m, apart_y_m = x_m[:, :, None] - x_m[:, None, :], y_m[:, :, None] - y_m[:, None, :]
        near = apart_x_m * apart_x_m + apart_y_m * apart_y_m < distance_m * distance_m
        worlds, firsts, seconds = np.nonzero(near & self._ordered)
        first_rows = worlds * self._shape[1]
        return first_rows + firsts, first_rows + seconds

    def _list_neighbors(self, positions_m: np.ndarray) -> None:
        """Look up who is near whom and what, unless this is known still."""
        if self._reach_m >= 0.0:
            return
        self._reach_m = _MARGIN_M
        self._firsts, self._seconds = self._find_pairs(positions_m, 2.0 * (BODY_RADIUS_M + _MARGIN_M))
        x_m, y_m = positions_m[..., None]
        away_x_m, away_y_m = self._obstacles.point_away(x_m, y_m)
        near_m = self._free_m + _MARGIN_M
        self._beside, near = np.nonzero(away_x_m * away_x_m + away_y_m * away_y_m < near_m * near_m)
        self._near, self._near_free_m = self._obstacles.take(near), self._free_m[near]

    def _push_apart(self, positions_m: np.ndarray) -> np.ndarray:
        """Move robots that touch each other apart, all at once and each half of the way; return their rows."""
        self._list_neighbors(positions_m)
        if not len(self._firsts):
            return self._firsts
        apart_x_m = positions_m[0, self._firsts] - positions_m[0, self._seconds]
        apart_y_m = positions_m[1, self._firsts] - positions_m[1, self._seconds]
        distance_m2 = apart_x_m * apart_x_m + apart_y_m * apart_y_m
        touching = np.nonzero(distance_m2 < (2.0 * BODY_RADIUS_M) ** 2 - _TOUCH_M)[0]
        if not len(touching):
            return touching
        firsts, seconds = self._firsts[touching], self._seconds[touching]
        distance_m = np.sqrt(np.maximum(distance_m2[touching], 1e-12))
        push_m = BODY_RADIUS_M - distance_m / 2.0
        for axis_m, apart_m in zip(positions_m, (apart_x_m, apart_y_m)):
            along_m = apart_m[touching] * (push_m / distance_m)
            np.add.at(axis_m, firsts, along_m)
            np.subtract.at(axis_m, seconds, along_m)
        pushed = np.concatenate((firsts, seconds))
        self._reach_m -= float(push_m.max() * np.bincount(pushed).max())
        return pushed

    def _push_out(self, positions_m: np.ndarray) -> np.ndarray:
        """Move robots out of the walls and obstacles that they touch, one after the other; return their rows."""
        self._list_neighbors(positions_m)
        if not len(self._beside):
            return self._beside
        touching = np.nonzero(self._measure_depths(positions_m, slice(None))[0] > _TOUCH_M)[0]
        if not len(touching):
            return touching
        rows = self._beside[touching]
        turns = np.arange(len(rows)) - np.searchsorted(rows, rows)
        for turn in range(turns.max() + 1):
            now = touching[turns == turn]
            depth_m, away_x, away_y = self._measure_depths(positions_m, now)
            push_m = np.maximum(depth_m, 0.0)
            positions_m[0, self._beside[now]] += away_x * push_m
            positions_m[1, self._beside[now]] += away_y * push_m
            self._reach_m -= float(push_m.max())
        return rows

    def _measure_depths(self, positions_m: np.ndarray, which: Any) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return how deep (m) robots are in obstacles near them, and the direction out (x, y); which: of the list."""
        rows = self._beside[which]
        away_x_m, away_y_m = self._near.take(which).point_away(positions_m[0, rows], positions_m[1, rows])
        distance_m = np.maximum(np.sqrt(away_x_m * away_x_m + away_y_m * away_y_m), 1e-9)
        return self._near_free_m[which] - distance_m, away_x_m / distance_m, away_y_m / distance_m
