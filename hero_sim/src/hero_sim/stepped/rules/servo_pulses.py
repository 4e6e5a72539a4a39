"""The servo pulses of all robots and their watchdog.

Pure: numpy only, arrays (2, R), left wheels and right wheels; the rules of MotorDriver in robot/motor_control.py.
"""

import numpy as np

from hero_node.robot_constants import PULSE_RANGE_US

from ...robot.clock import NEVER_MS
from ...robot_constants import MOTOR_WATCHDOG_MS
from ...world.world import World
from .robot_mask import RobotMask

_FORWARD = np.array([[-1.0], [1.0]])
"""The servos are mounted as mirror images: a pulse below the center drives the left wheel forward."""


class ServoPulses:
    """The pulses that go out.

    Attributes:
        centers_us: the calibration (2, R): pulses at which the wheels should rest, whole microseconds.
        check_ms: when check_watchdog() has to be called next.
    """

    def __init__(self, world: World, centers_us: np.ndarray) -> None:
        """Begin without pulses."""
        rows = centers_us.shape[1]
        self.centers_us = np.array(centers_us, dtype=float)
        self.check_ms = NEVER_MS
        self._world = world
        self._pulses_us = np.full((2, rows), np.nan)  # nan: no pulses go out
        self._stop_at_ms = np.full(rows, NEVER_MS)

    def write(self, now_ms: int, pulses_us: np.ndarray, which: RobotMask) -> None:
        """Write pulses (2, R), limited to 1000..2000 us, to the robots which."""
        stop_at_ms = now_ms + MOTOR_WATCHDOG_MS + 1
        np.copyto(self._stop_at_ms, stop_at_ms, where=which)
        self.check_ms = min(self.check_ms, stop_at_ms)
        changes = pulses_us != self._pulses_us
        if which is not True:
            changes &= which
        if np.count_nonzero(changes):
            np.copyto(self._pulses_us, pulses_us, where=which)
            least_us, most_us = PULSE_RANGE_US
            self._world.write_pulses(which, np.minimum(np.maximum(pulses_us, least_us), most_us))

    def drive(self, now_ms: int, outputs_us: np.ndarray, which: RobotMask) -> None:
        """Write outputs (2, R) of a controller beyond the centers, forward positive, to the robots which."""
        self.write(now_ms, self.centers_us + _FORWARD * outputs_us, which)

    def stop(self, rows: np.ndarray) -> None:
        """Stop the pulses of the robots at rows (K,)."""
        self._pulses_us[:, rows] = np.nan
        self._stop_at_ms[rows] = NEVER_MS
        self._world.release(rows)

    def check_watchdog(self, now_ms: int) -> None:
        """Stop the pulses that were written too long ago, and set check_ms."""
        self.stop(np.flatnonzero(self._stop_at_ms <= now_ms))
        self.check_ms = int(self._stop_at_ms.min())
