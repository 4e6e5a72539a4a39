"""Motor commands of all robots -> wheel travel, poses and collisions, one fixed step at a time.

Pure: numpy only, no clock, no socket. Everything is an array over robots. The firmware sets the motor
commands and reads the wheels; nothing here knows about messages.
What a pulse makes of a wheel, and how robots differ, is in robot_errors.
"""

import math
from typing import Dict, List, Tuple

import numpy as np

from ..robot_constants import BODY_RADIUS_M
from . import range_sensors
from .arena import Arena, distance_to_segments
from .kinematics import join_wheels, move_along_arc
from .robot_errors import MAX_WHEEL_M_S, SERVO_GAIN_M_S_US, RobotErrors

STEP_MS = 10
"""Length of a physics step; the fastest robot moves 3 mm in it, far less than its radius."""

_CONTACT_PASSES = 4
_TOUCH_M = 1e-9


class World:
    """All robots in one arena.

    Attributes:
        time_ms: end of the last step.
        poses: true poses (N, 3): x m, y m, theta rad, frame world.
        errors: how each robot differs from the drawing.
        commands_m_s: what the servos are told (N, 2), as the wheel speed it stands for, left and right.
        speeds_m_s, travels_m: of the wheels (N, 2).
    """

    def __init__(
        self, arena: Arena, poses: np.ndarray, rng: np.random.RandomState, errors: RobotErrors
    ) -> None:
        """Place robots at poses; slip, ripple and the noise of sensors are drawn from rng."""
        count = len(poses)
        self.arena = arena
        self.time_ms = 0
        self.poses = np.array(poses, dtype=float).reshape(count, 3)
        self.start_poses = self.poses.copy()
        self.commands_m_s = np.zeros((count, 2))
        self.speeds_m_s = np.zeros((count, 2))
        self.travels_m = np.zeros((count, 2))
        self.errors = errors
        # The share of the way to its target that a servo's speed goes in one step.
        self._servo_gain = -np.expm1(-STEP_MS / 1000.0 / errors.servo_lag_s)
        self._rng = rng
        self.present = np.ones(count, dtype=bool)
        self._pushes: Dict[int, Tuple[float, int]] = {}
        self.wheel_rows: List[List[float]] = []
        self._publish_rows()

    def _publish_rows(self) -> None:
        # The firmware reads single wheels many times a step: lists are far quicker there than arrays.
        self.wheel_rows = np.hstack((self.travels_m, self.speeds_m_s)).tolist()

    def read_wheels(self, index: int, time_ms: int) -> List[float]:
        """Return the travel (m) of the left and right wheel of a robot, at a time within the running step."""
        left_m, right_m, left_m_s, right_m_s = self.wheel_rows[index]
        ahead_s = (time_ms - self.time_ms) / 1000.0
        return [left_m + left_m_s * ahead_s, right_m + right_m_s * ahead_s]

    def write_pulses(self, index: int, left_us: float, right_us: float) -> None:
        """Give the servos of a robot pulses; below its centre the left wheel rolls forward."""
        centre_us = self.errors.servo_centre_us[index].tolist()
        dead_zone_us = float(self.errors.dead_zone_us[index, 0])
        gains = self.errors.servo_gain[index].tolist()
        self.commands_m_s[index] = [
            _convert_pulse(beyond_us, dead_zone_us, gain)
            for beyond_us, gain in zip((centre_us[0] - left_us, right_us - centre_us[1]), gains)
        ]

    def push(self, index: int, speed_m_s: float, for_ms: int) -> None:
        """Push a robot forward for so long; its wheels turn with it."""
        self._pushes[index] = (speed_m_s, self.time_ms + for_ms)

    def release(self, index: int) -> None:
        """Take the pulses of a robot away."""
        self.commands_m_s[index] = 0.0

    def step(self) -> None:
        """Move everything on by STEP_MS."""
        step_s = STEP_MS / 1000.0
        # Travel is taken with the speed of the step's start, so that reads within the step meet its end.
        rolled_m = self.speeds_m_s * step_s
        self.travels_m += rolled_m
        ripple_m_s = self._rng.standard_normal(self.speeds_m_s.shape) * self.errors.ripple_m_s
        reached_m_s = np.where(self.commands_m_s == 0.0, 0.0, self.commands_m_s + ripple_m_s)
        self.speeds_m_s += (reached_m_s - self.speeds_m_s) * self._servo_gain
        self.speeds_m_s[np.abs(self.speeds_m_s) < 1e-6] = 0.0
        for index, (speed_m_s, until_ms) in list(self._pushes.items()):
            self.speeds_m_s[index] = speed_m_s
            if self.time_ms >= until_ms:
                del self._pushes[index]
        self.time_ms += STEP_MS
        if rolled_m.any():
            self._move_bodies(rolled_m)
        self._publish_rows()

    def _move_bodies(self, rolled_m: np.ndarray) -> None:
        slipped = np.abs(self._rng.standard_normal(rolled_m.shape)) * self.errors.slip
        ground_m = rolled_m * self.errors.wheel_scale * (1.0 - slipped)
        before = self.poses[:, :2].copy()
        moved = move_along_arc(
            self.poses[:, 0], self.poses[:, 1], self.poses[:, 2], ground_m[:, 0], ground_m[:, 1]
        )
        self.poses[:] = np.column_stack(moved)
        self._separate(before)

    def _separate(self, before: np.ndarray) -> None:
        """Push bodies out of walls, obstacles and each other; who cannot get free stays where he was."""
        for _ in range(_CONTACT_PASSES):
            if not self._push_apart():
                return
        # Whoever still overlaps goes back to where he was free; that may block another, so look again.
        positions = self.poses[:, :2]
        while True:
            stuck = self.find_overlaps() & (positions != before).any(axis=1)
            if not stuck.any():
                return
            positions[stuck] = before[stuck]

    def _push_apart(self) -> bool:
        positions = self.poses[:, :2]
        moved = False
        if len(positions) > 1:
            apart = positions[:, None, :] - positions
            distance_m2 = (apart**2).sum(axis=2)
            np.fill_diagonal(distance_m2, np.inf)
            firsts, seconds = np.nonzero(distance_m2 < (2.0 * BODY_RADIUS_M) ** 2 - _TOUCH_M)
            if len(firsts):
                moved = True
                distance_m = np.sqrt(np.maximum(distance_m2[firsts, seconds], 1e-12))
                push = apart[firsts, seconds] * ((BODY_RADIUS_M - distance_m / 2.0) / distance_m)[:, None]
                np.add.at(positions, firsts, push)
        return self._push_off_walls(positions) or self._push_off_circles(positions) or moved

    def _push_off_walls(self, positions: np.ndarray) -> bool:
        if not len(self.arena.segments_m):
            return False
        distance_m, near_x, near_y = distance_to_segments(positions, self.arena.segments_m)
        robots, walls = np.nonzero(distance_m < BODY_RADIUS_M - _TOUCH_M)
        for robot, wall in zip(robots, walls):
            away = positions[robot] - (near_x[robot, wall], near_y[robot, wall])
            length_m = max(float(np.hypot(*away)), 1e-9)
            if length_m < BODY_RADIUS_M:
                positions[robot] += away * ((BODY_RADIUS_M - length_m) / length_m)
        return len(robots) > 0

    def _push_off_circles(self, positions: np.ndarray) -> bool:
        circles_m = self.arena.circles_m
        if not len(circles_m):
            return False
        apart = positions[:, None, :] - circles_m[:, :2]
        distance_m = np.hypot(apart[..., 0], apart[..., 1])
        robots, others = np.nonzero(distance_m < circles_m[:, 2] + BODY_RADIUS_M - _TOUCH_M)
        for robot, other in zip(robots, others):
            length_m = max(float(distance_m[robot, other]), 1e-9)
            wanted_m = circles_m[other, 2] + BODY_RADIUS_M
            positions[robot] += apart[robot, other] * ((wanted_m - length_m) / length_m)
        return len(robots) > 0

    def find_overlaps(self, slack_m: float = 1e-6) -> np.ndarray:
        """Return which robots (N,) reach more than slack_m into a wall, an obstacle or another robot."""
        positions = self.poses[:, :2]
        bad = np.zeros(len(positions), dtype=bool)
        if len(positions) > 1:
            apart = positions[:, None, :] - positions
            distance_m2 = (apart**2).sum(axis=2)
            np.fill_diagonal(distance_m2, np.inf)
            bad |= (distance_m2 < (2.0 * BODY_RADIUS_M - slack_m) ** 2).any(axis=1)
        if len(self.arena.segments_m):
            bad |= (distance_to_segments(positions, self.arena.segments_m)[0] < BODY_RADIUS_M - slack_m).any(
                axis=1
            )
        for x_m, y_m, radius_m in self.arena.circles_m:
            bad |= np.hypot(positions[:, 0] - x_m, positions[:, 1] - y_m) < radius_m + BODY_RADIUS_M - slack_m
        return bad

    def measure_body_speeds(self) -> np.ndarray:
        """Return linear (m/s) and turning speed (rad/s) of each robot (N, 2), as its wheels have it."""
        linear_m_s, turn_rad_s = join_wheels(self.speeds_m_s[:, 0], self.speeds_m_s[:, 1])
        return np.column_stack((linear_m_s, turn_rad_s))

    def read_infrared(self, which: np.ndarray) -> np.ndarray:
        """Return one noisy reading (whole counts, 0..1023) of the eight sensors of the robots which, (R,
        8)."""
        signals = range_sensors.measure_signals(
            self.poses,
            which,
            self.arena.segments_m,
            self.arena.circles_m,
            self.errors.alpha_counts_m2[which],
            self.errors.beta_counts[which],
        )
        noisy = signals + self._rng.normal(0.0, range_sensors.NOISE_COUNTS, signals.shape)
        # Adding zero turns -0.0 into 0.0, whose inverse is the right infinity.
        return np.clip(np.rint(noisy), 0, 1023) + 0.0

    def reset(self) -> None:
        """Put every robot back to its start, standing."""
        self.poses[:] = self.start_poses
        for motion in (self.commands_m_s, self.speeds_m_s):
            motion[:] = 0.0
        self._publish_rows()


def _convert_pulse(beyond_us: float, dead_zone_us: float, gain: float) -> float:
    """Return the wheel speed (m/s) of a servo whose pulse lies so far beyond its centre, forward positive."""
    driven_us = max(abs(beyond_us) - dead_zone_us, 0.0)
    return math.copysign(min(driven_us * SERVO_GAIN_M_S_US * gain, MAX_WHEEL_M_S), beyond_us)
