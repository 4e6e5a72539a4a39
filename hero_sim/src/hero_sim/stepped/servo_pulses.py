"""The servo pulses of all robots, their watchdog, and the wheel speeds that they command.

Pure: numpy only, arrays over robots (R) and wheels (left, right); the rules of MotorDriver in robot/motor_control.py
and of world/body.py.
"""

import numpy as np

from ..robot_constants import MOTOR_WATCHDOG_MS, PULSE_RANGE_US
from ..world.robot_errors import MAX_WHEEL_M_S, SERVO_GAIN_M_S_US
from ..world.world import World
from .which import Which, assign

__all__ = ["ServoPulses"]

_FORWARD = np.array([-1.0, 1.0])
"""The servos are mounted as mirror images: a pulse below the center drives the left wheel forward."""

_NEVER_MS = 2**62


class ServoPulses:
    """The pulses that go out.

    Attributes:
        centers_us: the calibration (R, 2): pulses at which the wheels should rest, whole microseconds.
        pulses_us: last pulses written (R, 2), whole microseconds.
        attached: whether pulses go out (R, 1).
        check_ms: when check_watchdog() has to be called next.
    """

    def __init__(self, world: World, centers_us: np.ndarray) -> None:
        """Begin without pulses."""
        rows = len(centers_us)
        self.centers_us = np.array(centers_us, dtype=float)
        self.pulses_us = np.zeros((rows, 2))
        self.attached = np.zeros((rows, 1), dtype=bool)
        self.check_ms = _NEVER_MS
        self._stop_at_ms = np.zeros((rows, 1), dtype=np.int64)
        self._world = world

    def write(self, now_ms: int, pulses_us: np.ndarray, which: Which) -> None:
        """Write pulses (R, 2), limited to 1000..2000 us, to the robots which."""
        stop_at_ms = now_ms + MOTOR_WATCHDOG_MS + 1
        assign(self._stop_at_ms, stop_at_ms, which)
        self.check_ms = min(self.check_ms, stop_at_ms)
        changes = pulses_us != self.pulses_us
        changes |= ~self.attached
        changes &= which
        if not changes.any():
            return
        assign(self.pulses_us, pulses_us, which)
        self.attached |= which
        assign(self._world.commands_m_s, self._convert(np.clip(pulses_us, *PULSE_RANGE_US)), which)

    def drive(self, now_ms: int, outputs_us: np.ndarray, which: Which) -> None:
        """Write outputs (R, 2) of a controller beyond the centers, forward positive, to the robots which."""
        self.write(now_ms, self.centers_us + _FORWARD * outputs_us, which)

    def stop(self, rows: np.ndarray) -> None:
        """Stop the pulses of the robots at rows (K,)."""
        self.attached[rows] = False
        self._world.commands_m_s[rows] = 0.0

    def check_watchdog(self, now_ms: int) -> None:
        """Stop the pulses that were written too long ago, and set check_ms."""
        ends = self.attached & (self._stop_at_ms <= now_ms)
        self.stop(np.flatnonzero(ends))
        self.check_ms = int(self._stop_at_ms.min(where=self.attached, initial=_NEVER_MS))

    def _convert(self, pulses_us: np.ndarray) -> np.ndarray:
        """Return the wheel speeds (m/s) that pulses (R, 2) stand for."""
        errors = self._world.errors
        beyond_us = (pulses_us - errors.servo_center_us) * _FORWARD
        driven_us = np.maximum(np.abs(beyond_us) - errors.dead_zone_us, 0.0)
        speeds_m_s = driven_us * SERVO_GAIN_M_S_US * errors.servo_gain
        return np.copysign(np.minimum(speeds_m_s, MAX_WHEEL_M_S), beyond_us)
