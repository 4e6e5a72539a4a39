"""Contacts of bodies with walls, obstacles and each other, solved one after the other in a fixed order.

Pure: numpy only, over all robots of all worlds at once; robots of different worlds never meet. Two robots that touch
push each other by the same amount, walls and obstacles do not move. Method: projected Gauss-Seidel over
displacements that begins with those of the step before, so that robots which press on each other hardly have to be
solved anew (E. Catto, Iterative Dynamics with Temporal Coherence, 2005).
"""

import math
from typing import Any, Tuple

import numpy as np

from .arena import Arena, list_obstacles, measure_clearance, square_length
from .compiled import compile_loop

_PASSES = 100
_SETTLED_M = 2e-5
"""A world whose pushes change by less in one pass is solved; few need more than five passes."""

_TOUCH_M = 1e-9

_SHIFT_M = 0.006
"""Largest approach of two robots, or of a robot and an obstacle, while a step's contacts are solved."""

_MARGIN_M = 0.03
"""Distance that bodies may move until their neighbors are listed again; a larger margin makes each step slower."""

_NONE, _NO_M = np.empty(0, dtype=int), np.empty(0)


def _relax(
    settled: float, x: Any, y: Any, firsts: Any, seconds: Any, wanted: Any, pushes: Any, pair_ends: Any,
    rows: Any, start_x: Any, start_y: Any, along_x: Any, along_y: Any, length2: Any, free: Any,
    wall_pushes: Any, wall_ends: Any,
) -> None:  # fmt: skip
    """Solve the contacts of each world, in place, until no push changes by settled (m). A loop for compile_loop().

    x, y: places (m) of all robots. Pair k, of the robots firsts[k] and seconds[k], is pushed by pushes[k] (m) each, to
    be wanted[k] apart; pair_ends: where the pairs of each world end. Robot rows[k] is pushed out of an obstacle by
    wall_pushes[k]; the obstacle is a segment (see Segments), from which its center has to be free[k] away.
    """
    begin = wall_begin = 0
    for world in range(len(pair_ends)):
        end, wall_end = pair_ends[world], wall_ends[world]
        for _ in range(_PASSES):
            changed = 0.0
            for k in range(begin, end):
                push = pushes[k]
                a, b = firsts[k], seconds[k]
                apart_x, apart_y = x[a] - x[b], y[a] - y[b]
                square = apart_x * apart_x + apart_y * apart_y
                if push == 0.0 and square >= wanted[k] * wanted[k]:
                    continue
                if square < 1e-18:
                    apart_x, square = 1e-9, 1e-18
                distance = math.sqrt(square)
                change = max((wanted[k] - distance) / 2.0, -push)
                pushes[k] = push + change
                changed = max(changed, abs(change))
                share = change / distance
                x[a] += apart_x * share
                y[a] += apart_y * share
                x[b] -= apart_x * share
                y[b] -= apart_y * share
            for k in range(wall_begin, wall_end):
                push = wall_pushes[k]
                a = rows[k]
                to_x, to_y = x[a] - start_x[k], y[a] - start_y[k]
                along = min(max((to_x * along_x[k] + to_y * along_y[k]) / length2[k], 0.0), 1.0)
                away_x, away_y = to_x - along * along_x[k], to_y - along * along_y[k]
                distance = max(math.sqrt(away_x * away_x + away_y * away_y), 1e-9)
                if push == 0.0 and distance >= free[k]:
                    continue
                change = max(free[k] - distance, -push)
                wall_pushes[k] = push + change
                changed = max(changed, abs(change))
                x[a] += away_x * (change / distance)
                y[a] += away_y * (change / distance)
            if changed < settled:
                break
        begin, wall_begin = end, wall_end


def _find_touching(gaps_m: np.ndarray, pushes_m: np.ndarray) -> Tuple[bool, np.ndarray, float]:
    """Return whether bodies touch, which of the entries could do so in this step (K,), and how far all may move.

    gaps_m: between each two bodies, negative if they overlap. pushes_m: of each in the last step.
    """
    min_gap_m = float(np.minimum.reduce(gaps_m, initial=np.inf))
    if min_gap_m >= -_TOUCH_M and not np.count_nonzero(pushes_m):
        return False, (gaps_m < _SHIFT_M).nonzero()[0], min_gap_m
    pushed = pushes_m != 0.0
    return True, ((gaps_m < _SHIFT_M) | pushed).nonzero()[0], min_gap_m


class Contacts:
    """Keeps all bodies of worlds with the same arena apart. Positions are arrays (2, R), x and y (m), world by world.

    Only those that are near each other are compared, and only when they could touch: how far all may move until then
    is kept. So what happens does not depend on when it is looked up.
    """

    def __init__(self, arena: Arena, worlds: int, radii_m: np.ndarray) -> None:
        """Expect bodies of radii_m (R,), spread evenly over the worlds."""
        rows = len(radii_m)
        self._radii_m = radii_m
        self._arena = arena
        self._shape = (worlds, rows // worlds)
        # Of each two robots the earlier one is the first.
        self._ordered = np.triu(np.ones((self._shape[1], self._shape[1]), dtype=bool), k=1)
        self._obstacles, obstacle_radii_m = list_obstacles(arena)
        self._free_m = radii_m[:, None] + obstacle_radii_m
        self._relax = compile_loop(_relax, rows)
        # How far all may still move until the lists are incomplete, and until two robots, and until a
        # robot and an obstacle could touch.
        self._reach_m = self._robots_gap_m = self._walls_gap_m = -np.inf
        # Two robots that are near each other (2, P) and how far each was pushed in the last step; a robot, an obstacle
        # near it, how far away its center has to be, and how far it was pushed.
        self._pairs, self._pushes_m = np.empty((2, 0), dtype=int), _NO_M
        self._touching_m = _NO_M  # distance of each two that touch
        self._beside, self._wall_pushes_m = np.empty((2, 0), dtype=int), _NO_M
        self._near, self._near_free_m = self._obstacles.take(_NONE), _NO_M
        self._world_ends = np.arange(1, worlds + 1) * self._shape[1]
        # Load what is compiled now: at the first contact robots in real time would pause meanwhile.
        self._solve(np.zeros((2, rows)), _NONE, _NO_M, _NONE)

    def could_touch(self, moved_m: float) -> bool:
        """Note how far the fastest has moved; return whether bodies could have come to touch something."""
        self._reach_m -= moved_m
        self._robots_gap_m -= moved_m
        self._walls_gap_m -= moved_m
        return self._robots_gap_m <= 0.0 or self._walls_gap_m <= 0.0

    def separate(self, positions_m: np.ndarray) -> None:
        """Push bodies out of walls, obstacles and each other, in place."""
        if self._reach_m < 0.0:
            self._list_neighbors(positions_m)
        touches, pairs, beside, wanted_m = False, _NONE, _NONE, _NO_M
        if self._robots_gap_m < _SHIFT_M:
            firsts, seconds = self._pairs
            pair_m = positions_m.take(self._pairs, axis=1)
            apart_m = pair_m[:, 0] - pair_m[:, 1]
            distance_m = np.sqrt(square_length(apart_m))
            touches, pairs, gap_m = _find_touching((distance_m - self._touching_m) / 2.0, self._pushes_m)
            self._robots_gap_m = min(gap_m, self._reach_m)
            # Robots that were placed into each other come apart step by step, never through a wall.
            wanted_m = np.minimum(distance_m[pairs] + _SHIFT_M, self._touching_m[pairs])
        if self._walls_gap_m < _SHIFT_M:
            rows = self._beside[0]
            away_m = self._near.point_away(positions_m.take(rows, axis=1))
            free_m = np.sqrt(square_length(away_m))
            enters, beside, gap_m = _find_touching(free_m - self._near_free_m, self._wall_pushes_m)
            self._walls_gap_m = min(gap_m, self._reach_m)
            touches |= enters
        if not touches:
            return
        before_m = positions_m.copy()
        if np.count_nonzero(self._pushes_m):
            pressed, ways_m = _take_ways(apart_m, distance_m, self._pushes_m)
            _push(positions_m, firsts[pressed], ways_m)
            _push(positions_m, seconds[pressed], -ways_m)
        if np.count_nonzero(self._wall_pushes_m):
            pressed, ways_m = _take_ways(away_m, free_m, self._wall_pushes_m)
            _push(positions_m, rows[pressed], ways_m)
        self._solve(positions_m, pairs, wanted_m, beside)
        self.could_touch(float(np.abs(positions_m - before_m).max()) * math.sqrt(2.0))
        # Those that press on each other are looked at in each step.
        if np.count_nonzero(self._pushes_m):
            self._robots_gap_m = 0.0
        if np.count_nonzero(self._wall_pushes_m):
            self._walls_gap_m = 0.0

    def _solve(self, positions_m: np.ndarray, pairs: np.ndarray, wanted_m: np.ndarray, beside: np.ndarray) -> None:
        """Solve the contacts of pairs, to be wanted_m apart, and of robots beside obstacles: entries of the lists."""
        firsts, seconds = self._pairs.take(pairs, axis=1)
        rows, near = self._beside[0, beside], self._near.take(beside)
        obstacles = (rows, *near.start_m, *near.along_m, near.length_m2, self._near_free_m[beside])
        pushes_m, wall_pushes_m = self._pushes_m[pairs], self._wall_pushes_m[beside]
        pair_ends, wall_ends = firsts.searchsorted(self._world_ends), rows.searchsorted(self._world_ends)
        robots = (firsts, seconds, wanted_m, pushes_m, pair_ends)
        self._relax(_SETTLED_M, *positions_m, *robots, *obstacles, wall_pushes_m, wall_ends)
        self._pushes_m[pairs], self._wall_pushes_m[beside] = pushes_m, wall_pushes_m
        if np.count_nonzero(rows[1:] == rows[:-1]):
            # Whatever presses, walls are never entered; where two of them meet, the last pass may have left one.
            robots = (_NONE, _NONE, _NO_M, _NO_M, np.zeros_like(pair_ends))
            self._relax(_TOUCH_M, *positions_m, *robots, *obstacles, 0.0 * wall_pushes_m, wall_ends)

    def _list_neighbors(self, positions_m: np.ndarray) -> None:
        """List which robots are near each other, and near what."""
        self._reach_m = _MARGIN_M
        near_m = _SHIFT_M + _MARGIN_M
        pairs = self._find_pairs(positions_m, 2.0 * float(self._radii_m.max()) + 2.0 * near_m)
        self._pushes_m = _carry_over(self._pairs, self._pushes_m, pairs, positions_m.shape[1])
        self._pairs, self._touching_m = pairs, self._radii_m.take(pairs).sum(axis=0)
        away_m = self._obstacles.for_each_place().point_away(positions_m[..., None])
        free_m = self._free_m + near_m
        entries = np.array((square_length(away_m) < free_m * free_m).nonzero())
        self._wall_pushes_m = _carry_over(self._beside, self._wall_pushes_m, entries, self._free_m.shape[1])
        self._beside = entries
        self._near, self._near_free_m = self._obstacles.take(entries[1]), self._free_m[entries[0], entries[1]]

    def _find_pairs(self, positions_m: np.ndarray, distance_m: float) -> np.ndarray:
        """Return the rows (2, P) of the first and the second of all two robots less than distance_m apart."""
        places_m = positions_m.reshape(2, *self._shape)
        near = square_length(places_m[..., None] - places_m[:, :, None]) < distance_m * distance_m
        worlds, firsts, seconds = (near & self._ordered).nonzero()
        first_rows = worlds * self._shape[1]
        return np.array((first_rows + firsts, first_rows + seconds))

    def measure_overlaps(self, positions_m: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return how deep (m) each robot is in another robot at most (R,), and in a wall or obstacle (R,)."""
        pairs = self._find_pairs(positions_m, 2.0 * float(self._radii_m.max()))
        distances_m = np.sqrt(square_length(positions_m[:, pairs[0]] - positions_m[:, pairs[1]]))
        depths_m = np.maximum(self._radii_m.take(pairs).sum(axis=0) - distances_m, 0.0)
        robots_m = np.zeros(positions_m.shape[1])
        # Not broadcast: numpy 2.2 reads past the end of values that are.
        np.maximum.at(robots_m, pairs.ravel(), np.tile(depths_m, 2))
        return robots_m, np.maximum(self._radii_m - measure_clearance(positions_m.T, self._arena), 0.0)


def _take_ways(ways_m: np.ndarray, lengths_m: np.ndarray, pushes_m: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return which entries (K,) are pushed, and how far along ways_m (2, P), of lengths_m (P,), by pushes_m (P,)."""
    pressed = (pushes_m != 0.0).nonzero()[0]  # of truth values: ten times as fast as of numbers
    return pressed, ways_m.take(pressed, axis=1) * (pushes_m[pressed] / np.maximum(lengths_m[pressed], _TOUCH_M))


def _push(positions_m: np.ndarray, rows: np.ndarray, ways_m: np.ndarray) -> None:
    """Move the robots at rows (K,), any of them several times, by ways_m (2, K), in place."""
    for axis_m, axis_ways_m in zip(positions_m, ways_m):
        axis_m += np.bincount(rows, axis_ways_m, len(axis_m))


def _carry_over(entries: np.ndarray, values: np.ndarray, wanted: np.ndarray, columns: int) -> np.ndarray:
    """Return the values (W,) of the wanted entries (2, W), zero for new ones; both in ascending order."""
    keys, wanted_keys = entries[0] * columns + entries[1], wanted[0] * columns + wanted[1]
    carried = np.zeros(len(wanted_keys))
    carried[np.isin(wanted_keys, keys)] = values[np.isin(keys, wanted_keys)]
    return carried
