"""Bodies that touch walls, obstacles or each other: who overlaps, and how they are pushed apart.

Pure: numpy only, over all robots of all worlds at once; robots of different worlds never meet.
"""

from typing import Tuple

import numpy as np

from ..robot_constants import BODY_RADIUS_M
from .arena import Arena, distance_to_segments, list_obstacles, measure_clearance

__all__ = ["Contacts"]

_PASSES = 4
_TOUCH_M = 1e-9
_OVERLAP_M = 1e-6


class Contacts:
    """The rules of touching in one arena. Positions are arrays (2, R), x and y (m), world by world."""

    def __init__(self, arena: Arena, worlds: int, rows: int) -> None:
        """Expect so many rows, spread evenly over the worlds."""
        self._arena = arena
        self._shape = (worlds, rows // worlds)
        # Infinite from a robot to itself.
        self._self_m2 = np.where(np.eye(self._shape[1], dtype=bool), np.inf, 0.0)
        self._obstacles_m, radii_m = list_obstacles(arena)
        self._free_m = radii_m + BODY_RADIUS_M

    def separate(self, positions_m: np.ndarray, before_m: np.ndarray) -> float:
        """Push bodies out of walls, obstacles and each other; those that cannot get free return to before_m.

        Returns how far (m) all may move from here before any can touch.
        """
        for _ in range(_PASSES):
            moved, gap_m = self._push_apart(positions_m)
            if not moved.any():
                return gap_m
        # Whatever still overlaps goes back to where it was free; that may block another, so look again.
        pressed = np.repeat(moved, self._shape[1])
        while True:
            stuck = pressed & self.find_overlaps(positions_m) & (positions_m != before_m).any(axis=0)
            if not stuck.any():
                return 0.0
            positions_m[:, stuck] = before_m[:, stuck]

    def _push_apart(self, positions_m: np.ndarray) -> Tuple[np.ndarray, float]:
        """Move touching bodies apart once; return in which worlds any moved (E,), and the smallest gap before."""
        moved = np.zeros(self._shape[0], dtype=bool)
        gap_m = np.inf
        if self._shape[1] > 1:
            apart_x_m, apart_y_m, distance_m2 = self._measure_pairs(positions_m)
            # Both of a pair may move.
            gap_m = float(np.sqrt(distance_m2.min())) / 2.0 - BODY_RADIUS_M
            if gap_m < 0.0:
                pairs = np.nonzero(distance_m2 < (2.0 * BODY_RADIUS_M) ** 2 - _TOUCH_M)
                moved[pairs[0]] = True
                distance_m = np.sqrt(np.maximum(distance_m2[pairs], 1e-12))
                share = (BODY_RADIUS_M - distance_m / 2.0) / distance_m
                firsts = pairs[0] * self._shape[1] + pairs[1]
                np.add.at(positions_m[0], firsts, apart_x_m[pairs] * share)
                np.add.at(positions_m[1], firsts, apart_y_m[pairs] * share)
        depths_m = self._free_m - distance_to_segments(positions_m.T, self._obstacles_m)[0]
        deepest_m = float(depths_m.max(initial=-np.inf))
        if deepest_m > _TOUCH_M:
            touching = depths_m > _TOUCH_M
            moved[np.nonzero(touching)[0] // self._shape[1]] = True
            for obstacle in np.nonzero(touching.any(axis=0))[0]:
                self._push_out(positions_m, np.nonzero(touching[:, obstacle])[0], obstacle)
        return moved, min(gap_m, -deepest_m)

    def _push_out(self, positions_m: np.ndarray, rows: np.ndarray, obstacle: int) -> None:
        """Move rows out of one obstacle; another that they touched may have moved them meanwhile."""
        center_m = positions_m[:, rows]
        distance_m, near_x_m, near_y_m = distance_to_segments(center_m.T, self._obstacles_m[obstacle : obstacle + 1])
        length_m = np.maximum(distance_m[:, 0], 1e-9)
        push = np.maximum(self._free_m[obstacle] - length_m, 0.0) / length_m
        positions_m[0, rows] += (center_m[0] - near_x_m[:, 0]) * push
        positions_m[1, rows] += (center_m[1] - near_y_m[:, 0]) * push

    def _measure_pairs(self, positions_m: np.ndarray) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return x and y (m) from each robot's fellows to itself and the squared distances, all (E, N, N)."""
        x_m, y_m = positions_m.reshape(2, *self._shape)
        apart_x_m, apart_y_m = x_m[:, :, None] - x_m[:, None, :], y_m[:, :, None] - y_m[:, None, :]
        return apart_x_m, apart_y_m, apart_x_m * apart_x_m + apart_y_m * apart_y_m + self._self_m2

    def find_overlaps(self, positions_m: np.ndarray) -> np.ndarray:
        """Return which robots (R,) reach more than 1 um into a wall, an obstacle or another robot."""
        distance_m2 = self._measure_pairs(positions_m)[2]
        overlaps = (distance_m2 < (2.0 * BODY_RADIUS_M - _OVERLAP_M) ** 2).any(axis=2).ravel()
        return overlaps | (measure_clearance(positions_m.T, self._arena) < BODY_RADIUS_M - _OVERLAP_M)
