"""Bodies that touch walls, obstacles or each other, and how they get apart.

Pure: numpy only, over all robots of all worlds at once; robots of different worlds never meet.
"""

import math
from typing import Tuple

import numpy as np

from ..robot_constants import BODY_RADIUS_M
from .arena import Arena, Segments, list_obstacles, measure_clearance, square_length

__all__ = ["Contacts"]

_PASSES = 4
_TOUCH_M = 1e-9
_TOUCHING_M2 = (2.0 * BODY_RADIUS_M) ** 2 - _TOUCH_M
_OVERLAP_M = 1e-6

_NOBODY = np.empty(0, dtype=int)

_AWAY = np.array([[1.0], [-1.0]])
"""Signs of the ways of the first and the second of two robots that are pushed apart."""

_MARGIN_M = 0.03
"""How far bodies may move until it is looked up anew who is near whom; more takes longer at each step."""


class Contacts:
    """Keeps all bodies of worlds with the same arena apart. Positions are arrays (2, R), x and y (m), world by world.

    Only those that are near each other are compared, and only when they could touch: how far all may move until then
    is kept. So what happens does not depend on when it is looked up.
    """

    def __init__(self, arena: Arena, worlds: int, rows: int) -> None:
        """Expect so many rows, spread evenly over the worlds."""
        self._arena = arena
        self._shape = (worlds, rows // worlds)
        # Of each two robots the earlier one is the first.
        self._ordered = np.triu(np.ones((self._shape[1], self._shape[1]), dtype=bool), k=1)
        self._obstacles, radii_m = list_obstacles(arena)
        self._free_m = radii_m + BODY_RADIUS_M
        # How far all may still move until the lists are incomplete, until two robots, and until a robot and an
        # obstacle could touch.
        self._reach_m = self._robots_gap_m = self._obstacles_gap_m = -np.inf
        # Two robots that are near each other (2, P); a robot, how many earlier entries it has, an obstacle near it, and
        # how far away its center has to be.
        self._pairs, self._beside, self._turns = np.empty((2, 0), dtype=int), _NOBODY, _NOBODY
        self._near, self._near_free_m = self._obstacles, self._free_m

    def could_touch(self, moved_m: float) -> bool:
        """Note how far the fastest has moved; return whether robots could have come to touch something."""
        self._note_move(moved_m)
        return self._robots_gap_m <= 0.0 or self._obstacles_gap_m <= 0.0

    def _note_move(self, moved_m: float) -> None:
        self._reach_m -= moved_m
        self._robots_gap_m -= moved_m
        self._obstacles_gap_m -= moved_m

    def separate(self, positions_m: np.ndarray, before_m: np.ndarray) -> None:
        """Push bodies out of walls, obstacles and each other, in place; those that stay stuck return to before_m."""
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
            self._note_move(np.inf)

    def find_overlaps(self, positions_m: np.ndarray) -> np.ndarray:
        """Return which robots (R,) reach more than 1 um into a wall, an obstacle or another robot."""
        overlaps = measure_clearance(positions_m.T, self._arena) < BODY_RADIUS_M - _OVERLAP_M
        overlaps[self._find_pairs(positions_m, 2.0 * BODY_RADIUS_M - _OVERLAP_M)] = True
        return overlaps

    def _find_pairs(self, positions_m: np.ndarray, distance_m: float) -> np.ndarray:
        """Return the rows (2, P) of the first and the second of all two robots less than distance_m apart."""
        places_m = positions_m.reshape(2, *self._shape)
        near = square_length(places_m[..., None] - places_m[:, :, None]) < distance_m * distance_m
        worlds, firsts, seconds = (near & self._ordered).nonzero()
        first_rows = worlds * self._shape[1]
        return first_rows + (firsts, seconds)

    def _list_neighbors(self, positions_m: np.ndarray) -> None:
        """Look up who is near whom and what, unless this is known still."""
        if self._reach_m >= 0.0:
            return
        self._reach_m = _MARGIN_M
        self._pairs = self._find_pairs(positions_m, 2.0 * (BODY_RADIUS_M + _MARGIN_M))
        away_m = self._obstacles.for_each_place().point_away(positions_m[..., None])
        near_m = self._free_m + _MARGIN_M
        self._beside, near = (square_length(away_m) < near_m * near_m).nonzero()
        self._turns = np.arange(len(near)) - self._beside.searchsorted(self._beside)
        self._near, self._near_free_m = self._obstacles.take(near), self._free_m[near]

    def _push_apart(self, positions_m: np.ndarray) -> np.ndarray:
        """Move robots that touch each other apart, all at once and each half of the way; return their rows."""
        if self._robots_gap_m > 0.0:
            return _NOBODY
        self._list_neighbors(positions_m)
        pairs_m = positions_m.take(self._pairs, axis=1)
        apart_m = pairs_m[:, 0] - pairs_m[:, 1]
        distance_m2 = square_length(apart_m)
        nearest_m2 = np.minimum.reduce(distance_m2, initial=np.inf)
        if nearest_m2 >= _TOUCHING_M2:
            self._robots_gap_m = min(math.sqrt(nearest_m2) / 2.0 - BODY_RADIUS_M, self._reach_m)
            return _NOBODY
        touching = (distance_m2 < _TOUCHING_M2).nonzero()[0]
        distance_m = np.sqrt(np.maximum(distance_m2[touching], 1e-12))
        push_m = BODY_RADIUS_M - distance_m / 2.0
        pushed = self._pairs.take(touching, axis=1).ravel()
        along_m = apart_m.take(touching, axis=1) * (push_m / distance_m)
        for axis_m, ways_m in zip(positions_m, (along_m[:, None] * _AWAY).reshape(2, -1)):
            np.add.at(axis_m, pushed, ways_m)
        most = int(np.maximum.reduce(np.bincount(pushed)))
        moved_m = max(push_m.tolist()) * most
        self._note_move(moved_m)
        if most == 1:
            # These touch no longer, and it is known how near the others could have come.
            distance_m2[touching] = np.inf
            gap_m = math.sqrt(np.minimum.reduce(distance_m2)) / 2.0 - BODY_RADIUS_M - moved_m
            self._robots_gap_m = min(gap_m, _TOUCH_M, self._reach_m)
        return pushed

    def _push_out(self, positions_m: np.ndarray) -> np.ndarray:
        """Move robots out of the walls and obstacles that they touch, one after the other; return their rows."""
        if self._obstacles_gap_m > 0.0:
            return _NOBODY
        self._list_neighbors(positions_m)
        depth_m, out = self._measure_depths(positions_m, self._beside, self._near, self._near_free_m)
        deepest_m = np.maximum.reduce(depth_m, initial=-np.inf)
        if deepest_m <= _TOUCH_M:
            self._obstacles_gap_m = min(-deepest_m, self._reach_m)
            return _NOBODY
        touching = (depth_m > _TOUCH_M).nonzero()[0]
        rows, turns = self._beside[touching], self._turns[touching]
        for turn in sorted(set(turns.tolist())):
            now = touching[turns == turn]
            beside = self._beside[now]
            if turn:
                measured = self._measure_depths(positions_m, beside, self._near.take(now), self._near_free_m[now])
                depth_m[now], out[:, now] = measured
            push_m = np.maximum(depth_m[now], 0.0)
            for axis_m, ways_m in zip(positions_m, out.take(now, axis=1) * push_m):
                axis_m[beside] += ways_m
            self._note_move(max(push_m.tolist()))
        return rows

    def _measure_depths(
        self, positions_m: np.ndarray, rows: np.ndarray, obstacles: Segments, free_m: np.ndarray
    ) -> Tuple[np.ndarray, np.ndarray]:
        """Return how deep (m) robots at rows (K,) are in an obstacle each, and the direction out (2, K)."""
        away_m = obstacles.point_away(positions_m.take(rows, axis=1))
        distance_m = np.maximum(np.sqrt(square_length(away_m)), 1e-9)
        return free_m - distance_m, away_m / distance_m
