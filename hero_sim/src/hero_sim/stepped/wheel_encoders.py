"""The wheel encoders of all robots, and the firmware's filtered wheel speeds.

Pure: numpy only, arrays over robots (R) and wheels (left, right); the rules of robot/wheel_odometry.py.
"""

import numpy as np

from ..robot.wheel_odometry import FILTER_FIRST_ERROR, FILTER_MEASURE_ERROR, FILTER_PROCESS_NOISE_S_M
from ..robot_constants import TICK_M
from ..world.world import World

__all__ = ["WheelEncoders"]


class WheelEncoders:
    """Counters and speed filters.

    Attributes:
        ticks: counts (R, 2) since the odometry was last set, as last read.
        filtered_m_s: speeds (R, 2) behind the filter, as last read.
    """

    def __init__(self, world: World) -> None:
        """Count from the present travel of the world's wheels, which are at rest."""
        self._world = world
        self.ticks = np.zeros_like(world.travels_m)
        self.filtered_m_s = np.zeros_like(world.travels_m)
        self._base_ticks = np.floor(world.travels_m / TICK_M)
        self._errors = np.full_like(world.travels_m, FILTER_FIRST_ERROR)
        self._read_at_ms = np.full((len(world.travels_m), 1), world.time_ms - 1)

    def count(self, now_ms: int) -> np.ndarray:
        """Return the counters (R, 2) at now_ms, a time within the running physics step, without reading them."""
        world = self._world
        travels_m = world.speeds_m_s * ((now_ms - world.time_ms) / 1000.0)
        travels_m += world.travels_m
        travels_m /= TICK_M
        np.floor(travels_m, out=travels_m)
        travels_m -= self._base_ticks
        return travels_m

    def read(self, now_ms: int, which: np.ndarray) -> None:
        """Read the counters and update the filtered speeds of the robots which (R, 1, bool)."""
        ticks = self.count(now_ms)
        speeds_m_s = ticks - self.ticks
        speeds_m_s *= TICK_M
        speeds_m_s /= (now_ms - self._read_at_ms) / 1000.0
        # A one-dimensional Kalman filter whose process noise grows with each change of its own estimate.
        gains = self._errors / (self._errors + FILTER_MEASURE_ERROR)
        changes_m_s = speeds_m_s
        changes_m_s -= self.filtered_m_s
        changes_m_s *= gains
        errors = 1.0 - gains
        errors *= self._errors
        errors += np.abs(changes_m_s) * FILTER_PROCESS_NOISE_S_M
        np.copyto(self.ticks, ticks, where=which)
        np.copyto(self._errors, errors, where=which)
        np.add(self.filtered_m_s, changes_m_s, out=self.filtered_m_s, where=which)
        np.copyto(self._read_at_ms, now_ms, where=which)

    def zero(self, row: int) -> None:
        """Zero the counters of one robot, as last read (Odometry.ino:234)."""
        self._base_ticks[row] += self.ticks[row]
        self.ticks[row] = 0.0
