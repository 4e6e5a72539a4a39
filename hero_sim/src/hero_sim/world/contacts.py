"""Contacts of bodies with walls, obstacles and each other, solved one after the other in a fixed order.

Pure: numpy only, over all robots of all worlds at once; robots of different worlds never meet. Two robots that touch
push each other by the same amount, walls and obstacles do not move. Method: projected Gauss-Seidel over
displacements that begins with those of the step before, so that robots which press on each other hardly have to be
solved anew (E. Catto, Iterative Dynamics with Temporal Coherence, 2005).
"""

import math
from typing import Any, Sequence, Tuple

import numpy as np

from .arena import Arena, list_obstacles, measure_clearance, square_length
from .compiled import compile_loops

_PASSES = 100
_SETTLED_M = 2e-5
"""A world whose pushes change by less in one pass is solved; few need more than five passes."""

_TOUCH_M = 1e-9

_SHIFT_M = 0.006
"""Largest approach of two robots, or of a robot and an obstacle, while a step's contacts are solved."""

_MARGIN_M = 0.03
"""Distance that bodies may move until their neighbors are listed again; a larger margin makes each step slower."""


def _warm_start(
    x: Any, y: Any, firsts: Any, seconds: Any, touching: Any, wanted: Any, pushes: Any,
    rows: Any, start_x: Any, start_y: Any, along_x: Any, along_y: Any, length2: Any,
    free: Any, wall_wanted: Any, wall_pushes: Any,
) -> Tuple[bool, bool, float]:  # fmt: skip
    """Find the contacts that matter in this step, and move robots as they were pushed in the last one, in place.

    Arguments are those of _relax(). Returns whether bodies touch, whether a robot is at two obstacles, and how far all
    may move until something could touch. A loop for compile_loops().
    """
    touches, has_corner, gap = False, False, math.inf
    first_x, first_y, second_x, second_y = [0.0] * len(x), [0.0] * len(x), [0.0] * len(x), [0.0] * len(x)
    for k in range(len(firsts)):
        a, b, push = firsts[k], seconds[k], pushes[k]
        apart_x, apart_y = x[a] - x[b], y[a] - y[b]
        distance = math.sqrt(apart_x * apart_x + apart_y * apart_y)
        between = (distance - touching[k]) / 2.0
        if between < gap:  # in lists twice as fast as min()
            gap = between
        # Robots that were placed into each other come apart step by step, never through a wall.
        wanted[k] = min(distance + _SHIFT_M, touching[k]) if between < _SHIFT_M or push != 0.0 else 0.0
        if push != 0.0:
            touches = True
            share = push / max(distance, _TOUCH_M)
            first_x[a] += apart_x * share
            first_y[a] += apart_y * share
            second_x[b] -= apart_x * share
            second_y[b] -= apart_y * share
    wall_x, wall_y, last = [0.0] * len(x), [0.0] * len(x), -1
    for k in range(len(rows)):
        a, push = rows[k], wall_pushes[k]
        to_x, to_y = x[a] - start_x[k], y[a] - start_y[k]
        along = min(max((to_x * along_x[k] + to_y * along_y[k]) / length2[k], 0.0), 1.0)
        away_x, away_y = to_x - along * along_x[k], to_y - along * along_y[k]
        distance = math.sqrt(away_x * away_x + away_y * away_y)
        between = distance - free[k]
        if between < gap:
            gap = between
        wall_wanted[k] = 0.0
        if between < _SHIFT_M or push != 0.0:
            wall_wanted[k] = free[k]
            has_corner = has_corner or a == last
            last = a
        if push != 0.0:
            touches = True
            share = push / max(distance, _TOUCH_M)
            wall_x[a] += away_x * share
            wall_y[a] += away_y * share
    touches = touches or gap < -_TOUCH_M
    if touches:
        for a in range(len(x)):
            x[a] = x[a] + first_x[a] + second_x[a] + wall_x[a]
            y[a] = y[a] + first_y[a] + second_y[a] + wall_y[a]
    return touches, has_corner, gap


def _relax(
    x: Any, y: Any, settled: float, firsts: Any, seconds: Any, wanted: Any, pushes: Any, pair_ends: Any,
    rows: Any, start_x: Any, start_y: Any, along_x: Any, along_y: Any, length2: Any,
    wall_wanted: Any, wall_pushes: Any, wall_ends: Any,
) -> None:  # fmt: skip
    """Solve the contacts of each world, in place, until no push changes by settled (m). A loop for compile_loops().

    x, y: places (m) of robots. Pair k, of the robots firsts[k] and seconds[k], is pushed by pushes[k] (m) each, to
    be wanted[k] apart; pair_ends: where the pairs of each world end. Robot rows[k] is pushed out of an obstacle by
    wall_pushes[k]; the obstacle is a segment (see Segments), from which its center has to be wall_wanted[k] away.
    What is wanted to be 0 apart does not matter in this step.
    """
    begin = wall_begin = 0
    for world in range(len(pair_ends)):
        end, wall_end = pair_ends[world], wall_ends[world]
        if begin == end and wall_begin == wall_end:
            continue
        pairs = [k for k in range(begin, end) if wanted[k] != 0.0]
        beside = [k for k in range(wall_begin, wall_end) if wall_wanted[k] != 0.0]
        for _ in range(_PASSES):
            changed = 0.0
            for k in pairs:
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
            for k in beside:
                push = wall_pushes[k]
                a = rows[k]
                to_x, to_y = x[a] - start_x[k], y[a] - start_y[k]
                along = min(max((to_x * along_x[k] + to_y * along_y[k]) / length2[k], 0.0), 1.0)
                away_x, away_y = to_x - along * along_x[k], to_y - along * along_y[k]
                distance = max(math.sqrt(away_x * away_x + away_y * away_y), 1e-9)
                if push == 0.0 and distance >= wall_wanted[k]:
                    continue
                change = max(wall_wanted[k] - distance, -push)
                wall_pushes[k] = push + change
                changed = max(changed, abs(change))
                x[a] += away_x * (change / distance)
                y[a] += away_y * (change / distance)
            if changed < settled:
                break
        begin, wall_begin = end, wall_end


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
        self._world_ends = np.arange(1, worlds + 1) * self._shape[1]
        self._hold, (self._warm_start, self._relax) = compile_loops(rows, _warm_start, _relax)
        self._no_pair_ends = self._hold(np.zeros(worlds, dtype=int))
        no_entries, nothing_m = np.empty((2, 0), dtype=int), np.empty(0)
        self._list_entries(no_entries, nothing_m, no_entries, nothing_m)
        # Load what is compiled now: at the first contact robots in real time would pause meanwhile.
        self._reach_m = np.inf
        self.separate(np.zeros((2, rows)))
        nothing = self._hold(nothing_m)
        self._solve(nothing, nothing, _SETTLED_M, self._no_pair_ends, nothing)
        # How far all may still move until the lists are incomplete, and until something could touch.
        self._reach_m = self._gap_m = -np.inf

    def could_touch(self, moved_m: float) -> bool:
        """Note how far the fastest has moved; return whether bodies could have come to touch something."""
        self._reach_m -= moved_m
        self._gap_m -= moved_m
        return self._gap_m <= 0.0

    def separate(self, positions_m: np.ndarray) -> None:
        """Push bodies out of walls, obstacles and each other, in place."""
        if self._reach_m < 0.0:
            self._list_neighbors(positions_m)
        before_m = positions_m.take(self._rows, axis=1)
        x, y = map(self._hold, before_m.copy())
        touches, has_corner, gap_m = self._warm_start(
            x, y, *self._robots, self._touching_m, self._wanted_m, self._pushes_m,
            *self._walls, self._free_near_m, self._wall_wanted_m, self._wall_pushes_m,
        )  # fmt: skip
        self._gap_m = min(gap_m, self._reach_m)
        if not touches:
            return
        self._solve(x, y, _SETTLED_M, self._pair_ends, self._wall_pushes_m)
        if has_corner:
            # Whatever presses, walls are never entered; where two of them meet, the last pass may have left one.
            self._solve(x, y, _TOUCH_M, self._no_pair_ends, self._hold(np.zeros(len(self._free_near_m))))
        places_m = np.array((x, y))
        positions_m[:, self._rows] = places_m
        self.could_touch(float(np.abs(places_m - before_m).max()) * math.sqrt(2.0))
        # Those that press on each other are looked at in each step.
        if np.count_nonzero(self._pushes_m) or np.count_nonzero(self._wall_pushes_m):
            self._gap_m = 0.0

    def _solve(self, x: Any, y: Any, settled_m: float, pair_ends: Any, wall_pushes_m: Any) -> None:
        pairs = (*self._robots, self._wanted_m, self._pushes_m, pair_ends)
        self._relax(x, y, settled_m, *pairs, *self._walls, self._wall_wanted_m, wall_pushes_m, self._wall_ends)

    def _list_neighbors(self, positions_m: np.ndarray) -> None:
        """List which robots are near each other, and near what."""
        self._reach_m = _MARGIN_M
        near_m = _SHIFT_M + _MARGIN_M
        pairs = self._find_pairs(positions_m, 2.0 * float(self._radii_m.max()) + 2.0 * near_m)
        pushes_m = _carry_over(self._pairs, self._pushes_m, pairs, positions_m.shape[1])
        away_m = self._obstacles.for_each_place().point_away(positions_m[..., None])
        free_m = self._free_m + near_m
        beside = np.array((square_length(away_m) < free_m * free_m).nonzero())
        wall_pushes_m = _carry_over(self._beside, self._wall_pushes_m, beside, self._free_m.shape[1])
        self._list_entries(pairs, pushes_m, beside, wall_pushes_m)

    def _list_entries(
        self, pairs: np.ndarray, pushes_m: np.ndarray, beside: np.ndarray, wall_pushes_m: np.ndarray
    ) -> None:
        """Note which robots are near each other, and near what, for loops that number only these robots.

        pairs (2, P) of robots, and how far each of them was pushed in the last step (P,). beside (2, Q): a robot and an
        obstacle, and how far it was pushed (Q,).
        """
        self._pairs, self._beside = pairs, beside
        (firsts, seconds), (rows, obstacles) = pairs, beside
        self._rows, numbers = np.unique(np.concatenate((firsts, seconds, rows)), return_inverse=True)
        self._robots = [self._hold(part) for part in numbers[: pairs.size].reshape(2, -1)]
        self._touching_m = self._hold(self._radii_m[firsts] + self._radii_m[seconds])
        self._wanted_m, self._pushes_m = self._hold(np.zeros(len(firsts))), self._hold(pushes_m)
        self._pair_ends = self._hold(firsts.searchsorted(self._world_ends))
        near = self._obstacles.take(obstacles)
        walls = (numbers[pairs.size :], *near.start_m, *near.along_m, near.length_m2)
        self._walls = [self._hold(part) for part in walls]
        self._free_near_m = self._hold(self._free_m[rows, obstacles])
        self._wall_wanted_m, self._wall_pushes_m = self._hold(np.zeros(len(rows))), self._hold(wall_pushes_m)
        self._wall_ends = self._hold(rows.searchsorted(self._world_ends))

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


def _carry_over(entries: np.ndarray, values: Sequence[float], wanted: np.ndarray, columns: int) -> np.ndarray:
    """Return the values (W,) of the wanted entries (2, W), zero for new ones; both in ascending order."""
    carried = np.asarray(values)
    if not np.count_nonzero(carried):
        return np.zeros(wanted.shape[1])
    keys, wanted_keys = entries[0] * columns + entries[1], wanted[0] * columns + wanted[1]
    found = keys.searchsorted(wanted_keys)
    known = keys.take(found, mode="clip") == wanted_keys
    return np.where(known, carried.take(found, mode="clip"), 0.0)
