"""Heading as the IMU hat reports it, in the firmware's units and with its delay.

Pure. Source: IMUSensor.ino. The hat fills a queue 100 times a second and the firmware takes one reading per
cycle, so its readings grow older, up to 0.24 s, until the queue overflows and is emptied.
"""

import math
from collections import deque
from typing import Deque, NamedTuple, Tuple

UNIT_QUATERNION = 16383.0 / 16384.0
"""The largest part of a quaternion that the hat sends (0.99994, a 14-bit fixed point number)."""

ANGULAR_COUNTS_PER_RAD_S = 16.4 * 180.0 / math.pi
"""Raw angular speed at a full scale of 2000 deg/s (assumption: the hat's usual scale)."""

GRAVITY = 8.192
"""1 g in the hat's unit: raw counts / 1000 (IMUSensor.ino:182-188)."""

OLDEST_MS = 240
_FILL_MS = 10


class ImuReading(NamedTuple):
    """One reading as the firmware sends it."""

    heading_rad: float  # since power-on, -pi..pi
    quaternion: Tuple[float, float, float, float]  # x y z w
    angular_counts: Tuple[float, float, float]
    acceleration: Tuple[float, float, float]


class ImuHat:
    """The hat of one robot; times are the robot's own milliseconds."""

    def __init__(self, heading_rad: float) -> None:
        """Begin with heading_rad (world) as zero."""
        self._start_rad = heading_rad
        self._age_ms = 0
        self._read_at_ms = 0
        self._queue: Deque[Tuple[int, float, float]] = deque()

    def read(self, now_ms: int, heading_rad: float, angular_rad_s: float) -> ImuReading:
        """Queue the true heading (world) and angular speed, and take the oldest reading from the queue."""
        self._queue.append((now_ms, heading_rad - self._start_rad, angular_rad_s))
        # Since the last read as many readings came as 10 ms fit in, and one was taken.
        self._age_ms += max(now_ms - self._read_at_ms - _FILL_MS, 0)
        if self._age_ms > OLDEST_MS:
            self._age_ms = 0
        self._read_at_ms = now_ms
        while self._queue[0][0] < now_ms - self._age_ms:
            self._queue.popleft()
        _, old_rad, old_rad_s = self._queue[0]
        old_rad = math.remainder(old_rad, 2.0 * math.pi)
        yaw_z, yaw_w = math.sin(old_rad / 2.0) * UNIT_QUATERNION, math.cos(old_rad / 2.0) * UNIT_QUATERNION
        angular_counts = (0.0, 0.0, float(round(old_rad_s * ANGULAR_COUNTS_PER_RAD_S)))
        return ImuReading(old_rad, (0.0, 0.0, yaw_z, yaw_w), angular_counts, (0.0, 0.0, GRAVITY))
