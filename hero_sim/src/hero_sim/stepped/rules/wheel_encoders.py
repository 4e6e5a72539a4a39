"""The wheel encoders of all robots, and the firmware's filtered wheel speeds.

Pure: numpy only, arrays (2, R), left wheels and right wheels; the rules of robot/wheel_odometry.py.
"""

import numpy as np

from ...robot.wheel_odometry import FILTER_FIRST_ERROR, FILTER_PROCESS_NOISE_S_M
from ...world import compile_loops, wheel_loops
from ...world.world import World
from .robot_mask import RobotMask


class WheelEncoders:
    """Counters and speed filters.

    Attributes:
        ticks: counts (2, R) since the odometry was last set, as last read.
        filtered_m_s: speeds (2, R) behind the filter, as last read.
        tick_m: travel per tick (R,) as the firmware computes it.
    """

    def __init__(self, world: World, tick_m: np.ndarray) -> None:
        """Count from the present travel of the world's wheels, which are at rest."""
        self.tick_m = tick_m
        self._travels_m, self._speeds_m_s = world.travels_m.T, world.speeds_m_s.T
        self._world = world
        self.ticks = np.zeros_like(self._travels_m)
        self.filtered_m_s = np.zeros_like(self._travels_m)
        self._base_ticks = np.floor(self._travels_m / tick_m)
        self._errors = np.full_like(self._travels_m, FILTER_FIRST_ERROR)
        self._read_at_ms = np.full(len(tick_m), world.time_ms - 1)
        self._loops, self._all = compile_loops(wheel_loops, len(tick_m)), np.ones(len(tick_m), dtype=bool)

    def count(self, now_ms: int) -> np.ndarray:
        """Return the counters (2, R) at now_ms, a time within the running physics step, without reading them."""
        travels_m = self._speeds_m_s * ((now_ms - self._world.time_ms) / 1000.0) + self._travels_m
        ticks: np.ndarray = np.floor(travels_m / self.tick_m) - self._base_ticks
        return ticks

    def read(self, now_ms: int, which: RobotMask) -> None:
        """Read the counters and update the filtered speeds of the robots which."""
        elapsed_s = (now_ms - self._read_at_ms) / 1000.0
        np.copyto(self._read_at_ms, now_ms, where=which)
        if self._loops is not None:
            self._loops.read_encoders(
                (now_ms - self._world.time_ms) / 1000.0, elapsed_s, FILTER_PROCESS_NOISE_S_M, self._all & which,
                self._travels_m, self._speeds_m_s, self.tick_m, self._base_ticks, self.ticks, self.filtered_m_s,
                self._errors,
            )  # fmt: skip
            return
        ticks = self.count(now_ms)
        speeds_m_s = (ticks - self.ticks) * self.tick_m / elapsed_s
        # A one-dimensional Kalman filter whose process noise grows with each change of its own estimate.
        gains = self._errors / (self._errors + 1.0)
        changes_m_s = (speeds_m_s - self.filtered_m_s) * gains
        errors = np.abs(changes_m_s) * FILTER_PROCESS_NOISE_S_M + gains
        np.copyto(self.ticks, ticks, where=which)
        np.copyto(self._errors, errors, where=which)
        np.copyto(self.filtered_m_s, self.filtered_m_s + changes_m_s, where=which)

    def zero(self, row: int) -> None:
        """Zero the counters of one robot, as last read (Odometry.ino:234)."""
        self._base_ticks[:, row] += self.ticks[:, row]
        self.ticks[:, row] = 0.0
