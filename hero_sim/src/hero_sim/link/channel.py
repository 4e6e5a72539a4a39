"""A Wi-Fi channel, whose airtime the robots and their access point share.

Pure: time enters in milliseconds. One frame is on the air at a time (802.11g, distributed coordination). Stations that
wait for it at the same time collide as often as Bianchi's model of saturated stations says (IEEE JSAC 18(3), 2000);
the same frame is sent up to eight times, then TCP sends it again.
"""

from bisect import bisect_left
from typing import Dict, Hashable, Tuple

import numpy as np

SEGMENT_LENGTH = 536
"""Bytes of data in one of the ESP8266's TCP segments."""

_HEADER_LENGTH = 76
"""Bytes of IP, TCP, link and MAC headers of a frame."""

_BYTES_PER_MS = 6750.0
"""54 Mbit/s, the highest rate of 802.11g."""

_FRAME_MS = 0.166
"""Time of a frame beside its bytes: DIFS 28, mean backoff 67.5, preamble 26, SIFS 10, acknowledgement 34 us."""

_ATTEMPTS = 8
_RESEND_MS = 500.0
"""Retransmission timeout of TCP: one tick of the ESP8266's slow TCP timer (lwIP)."""

_MAX_STATIONS = 101


def _find_collisions(stations: int) -> float:
    """Return the probability that a frame collides, while this many stations have one to send.

    Solves Bianchi's two equations for a contention window of 16 that doubles six times.
    """
    least, most = 0.0, 1.0
    for _ in range(40):
        collisions = (least + most) / 2.0
        slots = 1.0 + 16.0 + collisions * 16.0 * sum((2.0 * collisions) ** stage for stage in range(6))
        expected = 1.0 - (1.0 - 2.0 / slots) ** (stations - 1)
        least, most = (collisions, most) if expected > collisions else (least, collisions)
    return least


_COLLISIONS = [_find_collisions(max(stations, 1)) for stations in range(_MAX_STATIONS)]

_FAILURES = [[-(share**number) for number in range(1, _ATTEMPTS + 1)] for share in _COLLISIONS]
"""Minus the probability that as many attempts to send a frame collide, for each number of stations; ascending."""


class Channel:
    """The airtime of one channel, in the order in which frames are handed over."""

    def __init__(self, rng: np.random.RandomState) -> None:
        """Draw collisions from rng."""
        self._rng = rng
        self._busy_ms = 0.0
        self._ends_ms: Dict[Hashable, float] = {}  # of the last frame of each station that waits or sends

    def carry(self, at_ms: float, station: Hashable, length: int) -> Tuple[float, float]:
        """Send bytes that a station hands over at at_ms.

        Returns: when they have been sent; how much later they arrive, because one of their segments was lost (ms).
        """
        segments = -(-length // SEGMENT_LENGTH)
        self._ends_ms = {other: end_ms for other, end_ms in self._ends_ms.items() if end_ms > at_ms}
        self._ends_ms.setdefault(station, at_ms)
        # Each segment is a frame, and its acknowledgement by TCP another.
        airtime_ms = 2 * segments * _FRAME_MS + (length + 2 * segments * _HEADER_LENGTH) / _BYTES_PER_MS
        late_ms = 0.0
        waiting = min(len(self._ends_ms), _MAX_STATIONS - 1)
        if waiting > 1:
            failures = [bisect_left(_FAILURES[waiting], -share) for share in self._rng.random_sample(segments).tolist()]
            # A collision takes a frame's time once, and fails for two stations.
            repeated = sum(min(failed, _ATTEMPTS - 1) for failed in failures)
            airtime_ms += repeated * airtime_ms / segments / 4.0
            late_ms = _RESEND_MS if max(failures) >= _ATTEMPTS else 0.0
        self._busy_ms = max(self._busy_ms, at_ms) + airtime_ms
        self._ends_ms[station] = self._busy_ms
        return self._busy_ms, late_ms
