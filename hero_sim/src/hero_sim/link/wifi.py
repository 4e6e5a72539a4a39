"""A robot's radio: bytes in, the same bytes out at the time at which they would arrive.

Pure: time enters in milliseconds. Order is kept, as TCP keeps it; what the air loses comes late, not never.
Source: published recordings of one HeRo on Wi-Fi: gaps between odoms p95 44-53 ms, p99 48-113 ms, longest
148-1274 ms; ping 5-30 ms with spikes of 100-280 ms every few seconds.
"""

from collections import deque
from typing import Deque, Dict, List, NamedTuple, Tuple

import numpy as np


class WifiProfile(NamedTuple):
    """How good a network is; times in ms, each drawn anew."""

    base_ms: float  # least delay in one direction
    jitter_ms: float  # mean of the exponential delay on top
    spike_every_ms: float  # mean time between spikes, 0 for none
    spike_ms: Tuple[float, float]  # nothing passes for so long
    stall_every_ms: float  # the same for rare, long ones
    stall_ms: Tuple[float, float]
    bytes_per_s: float  # 0 for no limit


PROFILES: Dict[str, WifiProfile] = {
    "ideal": WifiProfile(0.0, 0.0, 0.0, (0.0, 0.0), 0.0, (0.0, 0.0), 0.0),
    "router": WifiProfile(2.0, 3.0, 10000.0, (30.0, 110.0), 0.0, (0.0, 0.0), 500e3),
    "hotspot": WifiProfile(3.0, 5.0, 4500.0, (100.0, 280.0), 60000.0, (400.0, 1200.0), 250e3),
    "bad": WifiProfile(5.0, 15.0, 2500.0, (100.0, 280.0), 20000.0, (500.0, 4000.0), 100e3),
}
"""ideal adds nothing. router and hotspot are the good and the common end of the recordings, bad is beyond
their worst: links that are lost for seconds."""


class _Quiet:
    """Times at which nothing passes, drawn one after another."""

    def __init__(self, every_ms: float, length_ms: Tuple[float, float], rng: np.random.RandomState) -> None:
        self._every_ms = every_ms
        self._length_ms = length_ms
        self._rng = rng
        self._start_ms = self._end_ms = -1.0
        self._draw(0.0)

    def _draw(self, from_ms: float) -> None:
        self._start_ms = from_ms + self._rng.exponential(self._every_ms)
        self._end_ms = self._start_ms + self._rng.uniform(*self._length_ms)

    def find_end(self, at_ms: float) -> float:
        """Return when something sent at at_ms can pass."""
        while self._end_ms < at_ms:
            self._draw(self._end_ms)
        return self._end_ms if self._start_ms <= at_ms else at_ms


class _Direction:
    def __init__(self) -> None:
        self.queue: Deque[Tuple[float, bytes]] = deque()
        self.busy_ms = 0.0  # end of the transmission of the last bytes


class Radio:
    """Both directions of one robot's connection."""

    def __init__(self, profile: WifiProfile, rng: np.random.RandomState) -> None:
        """Behave as profile says, with chance from rng."""
        self._profile = profile
        self._rng = rng
        self._quiet: List[_Quiet] = []
        for every_ms, length_ms in (
            (profile.spike_every_ms, profile.spike_ms),
            (profile.stall_every_ms, profile.stall_ms),
        ):
            if every_ms > 0:
                self._quiet.append(_Quiet(every_ms, length_ms, rng))
        self._up = _Direction()
        self._down = _Direction()
        self._stalled_until_ms = 0.0
        self._ideal = profile == PROFILES["ideal"]

    def is_transparent(self, now_ms: int) -> bool:
        """Return whether bytes pass at once, so that nobody needs to queue them."""
        return (
            self._ideal and now_ms >= self._stalled_until_ms and not self._up.queue and not self._down.queue
        )

    def stall(self, now_ms: int, for_ms: int) -> None:
        """Carry nothing for for_ms."""
        self._stalled_until_ms = now_ms + for_ms

    def clear(self) -> None:
        """Forget what is on its way, as when a connection ends."""
        self._up.queue.clear()
        self._down.queue.clear()

    def put_up(self, now_ms: int, data: bytes) -> None:
        """Take bytes from the robot."""
        self._put(self._up, now_ms, data)

    def put_down(self, now_ms: int, data: bytes) -> None:
        """Take bytes for the robot."""
        self._put(self._down, now_ms, data)

    def _put(self, direction: _Direction, now_ms: int, data: bytes) -> None:
        profile = self._profile
        at_ms = max(float(now_ms), self._stalled_until_ms)
        if not self._ideal:
            if profile.bytes_per_s:
                at_ms = max(at_ms, direction.busy_ms) + len(data) / profile.bytes_per_s * 1000.0
                direction.busy_ms = at_ms
            at_ms += profile.base_ms + self._rng.exponential(profile.jitter_ms)
            for quiet in self._quiet:
                at_ms = quiet.find_end(at_ms)
        # What was sent later may be due earlier; it waits in the queue behind the other all the same.
        direction.queue.append((at_ms, data))

    @property
    def is_carrying(self) -> bool:
        """Whether bytes are on their way."""
        return bool(self._up.queue or self._down.queue)

    @property
    def down_length(self) -> int:
        """How many bytes are on their way to the robot."""
        return sum(len(data) for _, data in self._down.queue)

    def take_up(self, now_ms: int) -> bytes:
        """Return what has reached the driver's side by now."""
        return self._take(self._up, now_ms)

    def take_down(self, now_ms: int) -> bytes:
        """Return what has reached the robot by now."""
        return self._take(self._down, now_ms)

    def _take(self, direction: _Direction, now_ms: int) -> bytes:
        queue = direction.queue
        if not queue or queue[0][0] > now_ms or now_ms < self._stalled_until_ms:
            return b""
        parts = []
        while queue and queue[0][0] <= now_ms:
            parts.append(queue.popleft()[1])
        return b"".join(parts)
