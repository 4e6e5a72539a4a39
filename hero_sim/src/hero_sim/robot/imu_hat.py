"""Heading as the IMU hat reports it, in the firmware's units and with its delay.

Pure. Source: IMUSensor.ino. The hat fills a queue 100 times a second and the firmware takes one reading per
cycle, so its readings grow older, up to 0.24 s, until the queue overflows and is emptied.
"""

import math
from collections import deque
from typing import Deque, Tuple

ANGULAR_COUNTS_PER_RAD_S = 16.4 * 180.0 / math.pi
"""Raw angular speed at a full scale of 2000 deg/s (assumption: the hat's usual scale)."""

OLDEST_MS = 240
_FILL_MS = 10


class ImuHat:
    """The hat of one robot; times are the robot's own milliseconds."""

    def __init__(self, heading_rad: float) -> None:
        """Begin with heading_rad (world) as zero."""
        self._start_rad = heading_rad
        self._age_ms = 0
        self._read_at_ms = 0
        self._queue: Deque[Tuple[int, float, float]] = deque()

    def read(self, now_ms: int, heading_rad: float, angular_rad_s: float) -> Tuple[float, float]:
        """Queue the true heading (world) and angular speed, and take the oldest reading from the queue.

        Returns the heading since power-on, -pi..pi rad, and the angular speed in raw counts.
        """
        self._queue.append((now_ms, heading_rad - self._start_rad, angular_rad_s))
        # Since the last read as many readings came as 10 ms fit in, and one was taken.
        self._age_ms += max(now_ms - self._read_at_ms - _FILL_MS, 0)
        if self._age_ms > OLDEST_MS:
            self._age_ms = 0
        self._read_at_ms = now_ms
        while self._queue[0][0] < now_ms - self._age_ms:
            self._queue.popleft()
        _, old_rad, old_rad_s = self._queue[0]
        return math.remainder(old_rad, 2.0 * math.pi), float(round(old_rad_s * ANGULAR_COUNTS_PER_RAD_S))
