"""The firmware's PID of one wheel: from target and measurement to the servo pulse beyond its center.

Pure. Source: the gains and limits of VelocityControl.ino:31-47 and PositionControl.ino:31-47, and the behavior of
the PID library that the firmware brings: it counts its sample time in microseconds, so the 50000 that the
firmware sets are 50 ms, and it computes at the first run after them; with a run every 21 ms that is every 63 ms.
With a motor like that of the measured build, the distance of its wheels over 3 s of driving differs by up to 7 %.
"""

from typing import NamedTuple

from hero_node import clamp

SAMPLE_MS = 50


class Gains(NamedTuple):
    """Gains of one wheel: us per unit of the error, per unit and second, and per unit a second."""

    proportional: float
    integral: float
    derivative: float


VELOCITY_GAINS = Gains(1200.0, 2300.0, 0.1)
"""Gains of an erased flash; the unit is m/s."""

POSITION_GAINS = Gains(5.0, 9.0, 0.1)
"""Gains of an erased flash; the unit is an encoder tick."""


class MotorPid:
    """The PID of one wheel; times are the robot's own milliseconds.

    Attributes:
        gains: as last set by set_gains().
        output_us: last output, whole microseconds, forward positive.
    """

    def __init__(self, gains: Gains, limit_us: float) -> None:
        """Begin at rest; the output stays within limit_us either way."""
        self.gains = gains
        self.output_us = 0
        self._limit_us = limit_us
        self._sum_us = 0.0
        self._last_input = 0.0
        self._computed_ms = -SAMPLE_MS

    def set_gains(self, gains: Gains) -> None:
        """Set gains; the library ignores a set with a negative one, and keeps its integral."""
        if min(gains) >= 0.0:
            self.gains = gains

    def reset(self) -> None:
        """Forget the integral and the last output."""
        self.output_us = 0
        self._sum_us = self._last_input = 0.0

    def run(self, now_ms: int, target: float, measured: float) -> None:
        """Compute a new output if it is time for one."""
        if now_ms - self._computed_ms < SAMPLE_MS:
            return
        self._computed_ms = now_ms
        sample_s = SAMPLE_MS / 1000.0
        error = target - measured
        self._sum_us = clamp(self._sum_us + self.gains.integral * sample_s * error, self._limit_us)
        damping_us = self.gains.derivative / sample_s * (measured - self._last_input)
        self._last_input = measured
        # The firmware truncates.
        self.output_us = int(clamp(self.gains.proportional * error + self._sum_us - damping_us, self._limit_us))
