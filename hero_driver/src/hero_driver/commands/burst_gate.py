"""When the next burst may go to a robot that tunes itself. Pure: times and readings go in.

A robot reads until nothing is left, and does nothing else meanwhile: a burst that comes before it has finished the last
keeps it deaf. How long it takes is not known (0.06 s and 0.17 s were measured), and TCP acknowledges for it at once, so
only its readings show that it has finished.
"""

from typing import Optional

from ..corrections.wheel_motion import WheelMotion

READINGS_MIN = 3
"""Two readings (34 ms apart) may leave between the acknowledgement and the robot's next reading cycle (51 ms)."""

WAIT_S = 2.0
"""To a robot that never gives readings the next burst goes after this time, and each further one after twice the time
of the last: the robot finishes sooner or later, whatever it takes for one."""


class BurstGate:
    """The bursts to one robot over one connection."""

    def __init__(self, wheels: WheelMotion) -> None:
        """wheels count the readings of the same connection."""
        self._wheels = wheels
        self._is_outstanding = False
        self._acknowledged_readings: Optional[int] = None  # number of readings when the last burst was
        self._wait_s = 0.0
        self._retry_s = 0.0

    def note_sent(self, now_s: float) -> None:
        """Close the gate behind a burst that was sent at now_s (monotonic), until the robot has finished it."""
        self._wait_s = 2.0 * self._wait_s if self._is_outstanding else WAIT_S
        self._retry_s = now_s + self._wait_s
        self._is_outstanding = True
        self._acknowledged_readings = None

    def is_open(self, is_acknowledged: bool, now_s: float) -> bool:
        """Return whether the next burst may go; is_acknowledged: whether the robot's TCP has the last one."""
        if self._is_outstanding and is_acknowledged:
            if self._acknowledged_readings is None:
                self._acknowledged_readings = self._wheels.readings
            self._is_outstanding = self._wheels.readings - self._acknowledged_readings < READINGS_MIN
        return not self._is_outstanding or (self._wheels.readings == 0 and now_s >= self._retry_s)
