"""The physics of all robots: wheel travel, poses and collisions, one fixed step at a time.

Pure: numpy only. Everything is an array over robots. The robots' bodies set servo commands and read the wheels;
nothing here knows about messages.
"""

from typing import List

import numpy as np

from ..robot_constants import BODY_RADIUS_M
from . import range_sensors
from .arena import Arena, distance_to_segments, list_obstacles, measure_clearance
from .kinematics import join_wheels, move_along_arc
from .robot_errors import RobotErrors

__all__ = ["STEP_MS", "World"]

STEP_MS = 10
"""Length of a physics step; the fastest robot moves 3 mm in it, far less than its radius."""

_CONTACT_PASSES = 4
_TOUCH_M = 1e-9
_OVERLAP_M = 1e-6


class World:
    """All robots in one arena.

    Attributes:
        time_ms: end of the last step.
        poses: true poses (N, 3): x m, y m, theta rad, frame world.
        errors: how each robot differs from the drawing.
        commands_m_s: the servos' commands (N, 2), as the wheel speeds they stand for, left and right.
        speeds_m_s, travels_m: of the wheels (N, 2).
        wheel_rows: travels and speeds of the wheels as lists: single reads are much faster than from arrays.
    """

    def __init__(
        self, arena: Arena, poses: np.ndarray, rng: np.random.RandomState, errors: RobotErrors
    ) -> None:
        """Place robots at poses; slip, ripple and sensor noise are drawn from rng."""
        count = len(poses)
        self.arena = arena
        self.time_ms = 0
        self.poses = np.array(poses, dtype=float).reshape(count, 3)
        self.commands_m_s = np.zeros((count, 2))
        self.speeds_m_s = np.zeros((count, 2))
        self.travels_m = np.zeros((count, 2))
        self.errors = errors
        self.wheel_rows: List[List[float]] = []
        # The share of the difference to its command by which a servo's speed changes in one step.
        self._servo_gain = -np.expm1(-STEP_MS / 1000.0 / errors.servo_lag_s)
        self._rng = rng
        self._obstacles_m, radii_m = list_obstacles(arena)
        self._free_m = radii_m + BODY_RADIUS_M
        self._update_rows()

    def _update_rows(self) -> None:
        self.wheel_rows = np.hstack((self.travels_m, self.speeds_m_s)).tolist()

    def step(self) -> None:
        """Move everything on by STEP_MS."""
        # Travel is taken with the speed of the step's start, so that reads within the step meet its end.
        rolled_m = self.speeds_m_s * (STEP_MS / 1000.0)
        self.travels_m += rolled_m
        ripple_m_s = self._rng.standard_normal(self.speeds_m_s.shape) * self.errors.ripple_m_s
        reached_m_s = np.where(self.commands_m_s == 0.0, 0.0, self.commands_m_s + ripple_m_s)
        self.speeds_m_s += (reached_m_s - self.speeds_m_s) * self._servo_gain
        self.speeds_m_s[np.abs(self.speeds_m_s) < 1e-6] = 0.0
        self.time_ms += STEP_MS
        if rolled_m.any():
            self._move_bodies(rolled_m)
        self._update_rows()

    def _move_bodies(self, rolled_m: np.ndarray) -> None:
        slipped = np.abs(self._rng.standard_normal(rolled_m.shape)) * self.errors.slip
        ground_m = rolled_m * self.errors.wheel_scale * (1.0 - slipped)
        before_m = self.poses[:, :2].copy()
        self.poses[:] = np.column_stack(move_along_arc(*self.poses.T, *ground_m.T))
        self._separate(before_m)

    def _separate(self, before_m: np.ndarray) -> None:
        """Push bodies out of walls, obstacles and each other; those that cannot get free stay where they were."""
        for _ in range(_CONTACT_PASSES):
            if not self._push_apart():
                return
        # Whatever still overlaps goes back to where it was free; that may block another, so look again.
        positions_m = self.poses[:, :2]
        while True:
            stuck = self.find_overlaps() & (positions_m != before_m).any(axis=1)
            if not stuck.any():
                return
            positions_m[stuck] = before_m[stuck]

    def _push_apart(self) -> bool:
        positions_m = self.poses[:, :2]
        moved = False
        if len(positions_m) > 1:
            apart_m = positions_m[:, None, :] - positions_m
            distance_m2 = (apart_m**2).sum(axis=2)
            np.fill_diagonal(distance_m2, np.inf)
            firsts, seconds = np.nonzero(distance_m2 < (2.0 * BODY_RADIUS_M) ** 2 - _TOUCH_M)
            if len(firsts):
                moved = True
                distance_m = np.sqrt(np.maximum(distance_m2[firsts, seconds], 1e-12))
                push_m = apart_m[firsts, seconds] * ((BODY_RADIUS_M - distance_m / 2.0) / distance_m)[:, None]
                np.add.at(positions_m, firsts, push_m)
        distance_m, near_x_m, near_y_m = distance_to_segments(positions_m, self._obstacles_m)
        robots, obstacles = np.nonzero(distance_m < self._free_m - _TOUCH_M)
        for robot, obstacle in zip(robots, obstacles):
            away_m = positions_m[robot] - (near_x_m[robot, obstacle], near_y_m[robot, obstacle])
            length_m = max(float(np.hypot(*away_m)), 1e-9)
            if length_m < self._free_m[obstacle]:
                positions_m[robot] += away_m * ((self._free_m[obstacle] - length_m) / length_m)
        return moved or len(robots) > 0

    def find_overlaps(self) -> np.ndarray:
        """Return which robots (N,) reach more than 1 um into a wall, an obstacle or another robot."""
        positions_m = self.poses[:, :2]
        distance_m2 = ((positions_m[:, None, :] - positions_m) ** 2).sum(axis=2)
        np.fill_diagonal(distance_m2, np.inf)
        overlaps = (distance_m2 < (2.0 * BODY_RADIUS_M - _OVERLAP_M) ** 2).any(axis=1)
        return overlaps | (measure_clearance(positions_m, self.arena) < BODY_RADIUS_M - _OVERLAP_M)

    def measure_body_speeds(self) -> np.ndarray:
        """Return linear (m/s) and angular speed (rad/s) of each robot (N, 2), as its wheels have it."""
        return np.column_stack(join_wheels(*self.speeds_m_s.T))

    def read_infrared(self, which: np.ndarray) -> np.ndarray:
        """Return one noisy reading (whole counts, 0..1023) of the eight sensors of the robots which, (R, 8)."""
        arena, errors = self.arena, self.errors
        signals = range_sensors.measure_signals(
            self.poses,
            which,
            arena.segments_m,
            arena.circles_m,
            errors.alpha_counts_m2[which],
            errors.beta_counts[which],
        )
        noisy = signals + self._rng.normal(0.0, range_sensors.NOISE_COUNTS, signals.shape)
        # Adding zero turns -0.0 into 0.0, whose inverse is the right infinity.
        return np.clip(np.rint(noisy), 0, 1023) + 0.0
