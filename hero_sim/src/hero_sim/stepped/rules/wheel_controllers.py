"""The firmware's velocity and position controller with their PIDs, for all robots.

Pure: numpy only, arrays (2, R), left wheels and right wheels; the rules of Controller in robot/motor_control.py and of
robot/motor_pid.py.
"""

from typing import Sequence, Union

import numpy as np

from ...robot.clock import LONG_AGO_MS
from ...robot.motor_pid import SAMPLE_MS, Gains
from ...robot_constants import COMMAND_GAP_MS
from .robot_mask import RobotMask, simplify

_SAMPLE_S = SAMPLE_MS / 1000.0


class WheelControllers:
    """One of the two controllers of each robot.

    Attributes:
        targets: of the wheels (2, R), m/s or ticks.
        outputs_us: last outputs (2, R), whole microseconds beyond the centers, forward positive.
        end_ms: when the last of them is stopped by its watchdog, unless commands come.
    """

    def __init__(self, rows: int, gains: Gains, limit_us: float, timeout_ms: int) -> None:
        """Begin without a command; the outputs stay within limit_us either way."""
        self.targets = np.zeros((2, rows))
        self.outputs_us = np.zeros((2, rows))
        self.end_ms = self._all_end_ms = LONG_AGO_MS
        self._limit_us = limit_us
        self._timeout_ms = timeout_ms
        self._gains = np.tile(np.reshape(gains, (3, 1, 1)), (1, 2, rows))
        self._watchdog_ms = np.full(rows, LONG_AGO_MS, dtype=np.int64)
        self._computed_ms = np.full(rows, LONG_AGO_MS, dtype=np.int64)
        self._due_ms = LONG_AGO_MS  # when the first of them computes again
        self._sums_us = np.zeros((2, rows))
        self._last_inputs = np.zeros((2, rows))
        self._scale_gains()

    def _scale_gains(self) -> None:
        self._proportional = self._gains[0]
        self._integral_step = self._gains[1] * _SAMPLE_S
        self._derivative_step = self._gains[2] / _SAMPLE_S

    def set_gains(self, row: int, gains: Sequence[float]) -> None:
        """Set lkp lki lkd rkp rki rkd of one robot; the firmware ignores a wheel's three with a negative one."""
        for wheel, three in enumerate((gains[:3], gains[3:])):
            if min(three) >= 0.0:
                self._gains[:, wheel, row] = three
        self._scale_gains()

    def find_accepted(self, now_ms: int, rows: np.ndarray) -> np.ndarray:
        """Return for each of the robots at rows (K,) whether it accepts a command at now_ms.

        A command that comes within 50 ms of the last accepted motion is dropped, a zero too.
        """
        return now_ms - self._watchdog_ms[rows] >= COMMAND_GAP_MS

    def command(self, now_ms: int, rows: np.ndarray, targets: np.ndarray) -> np.ndarray:
        """Set the targets (2, K) of the robots at rows (K,), each named once; return those that zeros have stopped.

        A wheel that has to reverse restarts its PID.
        """
        moves = np.logical_or(*targets)
        stopped, rows, targets = rows[~moves], rows[moves], targets[:, moves]
        self._watchdog_ms[stopped] = LONG_AGO_MS
        self._reset(slice(None), stopped)
        if len(rows):
            wheels, places = np.nonzero(targets * self.targets[:, rows] < 0.0)
            self._reset(wheels, rows[places])
            self.targets[:, rows] = targets
            self._watchdog_ms[rows] = now_ms
            self.end_ms = now_ms + self._timeout_ms
        self._all_end_ms = int(self._watchdog_ms.min()) + self._timeout_ms
        return stopped

    def _reset(self, wheels: Union[slice, np.ndarray], rows: np.ndarray) -> None:
        if not len(rows):
            return
        for values in (self.outputs_us, self._sums_us, self._last_inputs):
            values[wheels, rows] = 0.0

    def find_active(self, now_ms: int) -> RobotMask:
        """Return which controllers run."""
        return now_ms < self._all_end_ms or self._watchdog_ms > now_ms - self._timeout_ms

    def run(self, now_ms: int, measured: np.ndarray, active: RobotMask) -> None:
        """Compute new outputs from what was measured (2, R), for those active robots for whom it is time."""
        if now_ms < self._due_ms:
            return
        due = simplify((self._computed_ms <= now_ms - SAMPLE_MS) & active)
        if due is False:
            return
        error, limit_us = self.targets - measured, self._limit_us
        sums_us = np.clip(self._integral_step * error + self._sums_us, -limit_us, limit_us)
        damping_us = (measured - self._last_inputs) * self._derivative_step
        outputs_us = np.trunc(np.clip(self._proportional * error + sums_us - damping_us, -limit_us, limit_us))
        np.copyto(self._sums_us, sums_us, where=due)
        np.copyto(self._last_inputs, measured, where=due)
        np.copyto(self.outputs_us, outputs_us, where=due)
        np.copyto(self._computed_ms, now_ms, where=due)
        self._due_ms = int(self._computed_ms.min()) + SAMPLE_MS
