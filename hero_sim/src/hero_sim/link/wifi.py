"""A robot's Wi-Fi: bytes in, the same bytes out at the time at which they would arrive.

Pure: time enters in milliseconds. Order is kept, as TCP keeps it; what the air loses arrives late, not never.
Source: published recordings of one HeRo on Wi-Fi: gaps between odoms p95 44-53 ms, p99 48-113 ms, longest
148-1274 ms; ping 5-30 ms with spikes of 100-280 ms every few seconds.
"""

from collections import deque
from typing import Deque, Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from ..errors import OptionError
from ..key_values import parse_values
from .channel import Channel

MAX_CHANNELS = 100


class WifiProfile(NamedTuple):
    """Quality of a network; times in ms, each drawn at random."""

    base_ms: float  # least delay in one direction
    jitter_ms: float  # mean of the exponential delay on top
    bytes_per_s: float  # 0 for no limit
    outages_ms: Sequence[Tuple[float, float, float]] = ()  # mean time between two; shortest and longest


PROFILES: Dict[str, WifiProfile] = {
    "ideal": WifiProfile(0.0, 0.0, 0.0),
    "router": WifiProfile(2.0, 3.0, 500e3, [(10000.0, 30.0, 110.0)]),
    "hotspot": WifiProfile(3.0, 5.0, 250e3, [(4500.0, 100.0, 280.0), (60000.0, 400.0, 1200.0)]),
    "bad": WifiProfile(5.0, 15.0, 100e3, [(2500.0, 100.0, 280.0), (20000.0, 500.0, 4000.0)]),
}
"""ideal adds nothing. router and hotspot are the good and the common end of the recordings, bad is beyond
their worst: links that are lost for seconds."""


def parse_wifi(text: str) -> Tuple[WifiProfile, int]:
    """Return the profile and the number of channels of `PROFILE[,channels=C]`; 0: no robot takes another's airtime.

    Raises: OptionError.
    """
    name, _, values = text.partition(",")
    if name not in PROFILES:
        raise OptionError(f"--wifi {text!r}: must be one of {', '.join(PROFILES)}, or with channels: router,channels=3")
    if name == "ideal" and values:
        raise OptionError(f"--wifi {text!r}: ideal has no channels; leave them out, or take router")
    channels = parse_values(f"--wifi {text!r}", values, {"channels": (0, MAX_CHANNELS)}).get("channels", 1)
    if channels != int(channels):
        raise OptionError(f"--wifi {text!r}: channels must be a whole number")
    return PROFILES[name], 0 if name == "ideal" else int(channels)


def build_network(profile: WifiProfile, channels: int, seeds: Sequence[int]) -> List["Radio"]:
    """Return the radio of each robot of a network, one for each seed, spread over its channels in turn."""
    shared = [Channel(np.random.RandomState([seed, 1])) for seed in seeds[:channels]]
    return [
        Radio(profile, np.random.RandomState(seed), shared[row % len(shared)] if shared else None)
        for row, seed in enumerate(seeds)
    ]


class _Outages:
    """Times at which nothing passes, drawn one after another."""

    def __init__(self, outages_ms: Tuple[float, float, float], rng: np.random.RandomState) -> None:
        self._outages_ms = outages_ms
        self._rng = rng
        self._draw(0.0)

    def _draw(self, from_ms: float) -> None:
        interval_ms, min_ms, max_ms = self._outages_ms
        self._start_ms = from_ms + self._rng.exponential(interval_ms)
        self._end_ms = self._start_ms + self._rng.uniform(min_ms, max_ms)

    def find_end(self, at_ms: float) -> float:
        """Return when bytes sent at at_ms can pass."""
        while self._end_ms < at_ms:
            self._draw(self._end_ms)
        return self._end_ms if self._start_ms <= at_ms else at_ms


class _Direction:
    def __init__(self, radio: "Radio", station: object) -> None:
        self._radio = radio
        self._station = station
        self.busy_ms = 0.0  # end of the transmission of the last bytes
        self._last_ms = 0.0  # their arrival
        self.queue: Deque[Tuple[float, bytes]] = deque()

    @property
    def length(self) -> int:
        """Number of bytes in flight."""
        return sum(len(data) for _, data in self.queue)

    def send(self, now_ms: int, length: int) -> float:
        """Return when bytes arrive that are sent now (ms)."""
        bytes_per_s = self._radio.profile.bytes_per_s
        at_ms = max(float(now_ms), self._radio.stalled_until_ms)
        if bytes_per_s:
            at_ms = self.busy_ms = max(at_ms, self.busy_ms) + length / bytes_per_s * 1000.0
        if self._radio.channel:
            self.busy_ms, late_ms = self._radio.channel.carry(at_ms, self._station, length)
            at_ms = self.busy_ms + late_ms
        # What was sent later may be due earlier; it waits behind the other all the same.
        self._last_ms = max(self._last_ms, self._radio.find_arrival(at_ms))
        return self._last_ms

    def put(self, now_ms: int, data: bytes) -> None:
        """Send bytes, which take() then returns."""
        self.queue.append((self.send(now_ms, len(data)), data))

    def clear(self) -> None:
        """Drop what is on its way."""
        self.queue.clear()
        self._last_ms = self.busy_ms = 0.0

    def take(self, now_ms: int) -> bytes:
        """Return what has arrived by now."""
        parts = []
        if now_ms >= self._radio.stalled_until_ms:
            while self.queue and self.queue[0][0] <= now_ms:
                parts.append(self.queue.popleft()[1])
        return b"".join(parts)


class Radio:
    """Both directions of one robot's connection.

    Attributes:
        profile: how good it is.
        channel: which it shares with others, if any.
        stalled_until_ms: until when it carries nothing.
        up, down: from the robot to the driver, and back.
    """

    def __init__(self, profile: WifiProfile, rng: np.random.RandomState, channel: Optional[Channel] = None) -> None:
        """Delay bytes as profile says, with delays drawn from rng."""
        self.profile = profile
        self.channel = channel
        self.stalled_until_ms = 0
        self._is_ideal = profile == PROFILES["ideal"]
        self._rng = rng
        self._outages = [_Outages(outages_ms, rng) for outages_ms in profile.outages_ms]
        self.up = _Direction(self, self)
        # Whatever goes down is sent by the access point, one station.
        self.down = _Direction(self, channel)

    @property
    def is_carrying(self) -> bool:
        """Return whether bytes are on their way."""
        return bool(self.up.queue or self.down.queue)

    def is_congested(self, now_ms: int) -> bool:
        """Return whether what the robot sent last still waits for the channel: its next write blocks."""
        return self.channel is not None and self.up.busy_ms > now_ms

    def is_transparent(self, now_ms: int) -> bool:
        """Return whether bytes pass at once, without a queue."""
        return self._is_ideal and now_ms >= self.stalled_until_ms and not self.is_carrying

    def find_arrival(self, at_ms: float) -> float:
        """Return when bytes arrive that leave at at_ms."""
        at_ms += self.profile.base_ms + self._rng.exponential(self.profile.jitter_ms)
        for outages in self._outages:
            at_ms = outages.find_end(at_ms)
        return at_ms

    def stall(self, now_ms: int, for_ms: int) -> None:
        """Carry nothing for for_ms."""
        self.stalled_until_ms = now_ms + for_ms

    def clear(self) -> None:
        """Drop what is on its way, as when a connection ends."""
        self.up.clear()
        self.down.clear()
