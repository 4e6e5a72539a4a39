"""Who may connect: the address allow-list, the limits on connections and on what one of them may send. Pure."""

import collections
import ipaddress
from dataclasses import dataclass
from typing import Counter, Dict, Optional, Tuple, Union

Network = Union[ipaddress.IPv4Network, ipaddress.IPv6Network]

RATE_WINDOW_S = 1.0
"""Rates are judged over windows of this length."""

GARBAGE_LENGTH_MAX = 65536
"""Bytes without a good packet after which a peer is none of ours; a robot's truncated packet has below 1 kB."""

GARBAGE_REST_LENGTH = 4096
"""So much without a good packet is no robot's leftover of an earlier connection; it comes with one read."""

GARBAGE_REST_S = 0.2
"""Between two reads of a stranger that sends garbage: to search one read takes up to 1 ms, so that it delays fewer than
one message of a hundred."""

ARRIVALS_PER_S = 5.0
"""New robots of one address for which topics are set up, after as many at once as it may have connections: each costs
20 calls to the ROS master. One hundred simulated robots that are started again every 30 s stay below it."""

STAY_S = 2.0
"""A robot that leaves sooner is a passer: more of them than PASSERS_MAX, and the next robots of that address get no
topics before they have stayed for HOLD_S, so that a program that comes under ever new names costs the others little."""

PASSERS_MAX = 5
PASSERS_PER_S = 0.5
HOLD_S = 1.0

_MOST_HOSTS = 1000


class Allowance:
    """How often something may happen at each address: so often at once, and so often per second after that."""

    def __init__(self, most: float, per_s: float) -> None:
        self._most = most
        self._per_s = per_s
        # Address -> how often it may happen still, and when that was so.
        self._left: Dict[str, Tuple[float, float]] = {}

    def has_some(self, host: str, now_s: float) -> bool:
        """Return whether it may happen once more."""
        return self._count_left(host, now_s) >= 1.0

    def use(self, host: str, now_s: float) -> None:
        """It happened."""
        self._left[host] = (max(0.0, self._count_left(host, now_s) - 1.0), now_s)
        if len(self._left) > _MOST_HOSTS:
            # Those that have everything again are as good as unknown.
            self._left = {
                other: left
                for other, left in self._left.items()
                if self._count_left(other, now_s) < self._most
            }

    def _count_left(self, host: str, now_s: float) -> float:
        left, then_s = self._left.get(host, (self._most, now_s))
        return min(self._most, left + self._per_s * (now_s - then_s))


@dataclass(frozen=True)
class AdmissionLimits:
    """Limits on connections."""

    allow: Tuple[Network, ...] = ()  # empty: every address
    max_connections: int = 200
    max_connections_per_address: int = 200
    max_unidentified: int = 100


class Admission:
    """Counts connections and says which one is one too many."""

    def __init__(self, limits: AdmissionLimits) -> None:
        self._limits = limits
        self._by_host: Counter[str] = collections.Counter()
        self._unidentified: Counter[str] = collections.Counter()
        self._total = 0
        self._arrivals = Allowance(limits.max_connections_per_address, ARRIVALS_PER_S)
        self._passers = Allowance(PASSERS_MAX, PASSERS_PER_S)

    def admit(self, host: str) -> Optional[str]:
        """Count a connection from host; return why it is refused, None if it may stay."""
        refusal = self._find_refusal(host)
        if refusal is None:
            self._total += 1
            self._by_host[host] += 1
            self._unidentified[host] += 1
        return refusal

    def find_crowd(self, host: str) -> Optional[str]:
        """Return the address whose oldest connection that did not say who it is should make room for host's.

        None while there is room, where host may not come anyway, or where no address has more of them than
        host would have: so one that holds connections which say nothing keeps only itself out.
        """
        if self._find_lasting_refusal(host) is not None or self.unidentified < self._limits.max_unidentified:
            return None
        crowd, count = self._unidentified.most_common(1)[0]
        return crowd if count > self._unidentified[host] + 1 else None

    def find_largest(self, host: str) -> Optional[str]:
        """Return the address that should give up a connection for one of host's, because all places are taken.

        None while there is room, where host may not come anyway, or where no address has more connections than host
        would have: so one address cannot keep others out, whatever it says that it is.
        """
        if self._total < self._limits.max_connections or self._find_own_refusal(host) is not None:
            return None
        largest, count = self._by_host.most_common(1)[0]
        return largest if count > self._by_host[host] + 1 else None

    def note_identified(self, host: str) -> None:
        """A connection of host has said who it is, or ended before that."""
        self._unidentified[host] -= 1
        if not self._unidentified[host]:
            del self._unidentified[host]

    def admit_arrival(self, host: str, now_s: float) -> Optional[str]:
        """Count a robot of host that nobody knows; return why it has to wait, None if it may come.

        A peer that calls itself differently each time would keep the ROS master and the registrar busy.
        """
        if not self._arrivals.has_some(host, now_s):
            return "more than %d new robots of one address, and %g more per second" % (
                self._limits.max_connections_per_address,
                ARRIVALS_PER_S,
            )
        self._arrivals.use(host, now_s)
        return None

    def note_departure(self, host: str, stayed_s: float, now_s: float) -> None:
        """A robot of host has left after stayed_s."""
        if stayed_s < STAY_S:
            self._passers.use(host, now_s)

    def find_hold_s(self, host: str, now_s: float) -> float:
        """Return how long a robot of host has to stay before its topics are set up."""
        return 0.0 if self._passers.has_some(host, now_s) else HOLD_S

    def release(self, host: str) -> None:
        """An admitted connection from host is gone."""
        self._total -= 1
        self._by_host[host] -= 1
        if not self._by_host[host]:
            del self._by_host[host]

    @property
    def unidentified(self) -> int:
        """How many connections have not said who they are."""
        return sum(self._unidentified.values())

    def _find_refusal(self, host: str) -> Optional[str]:
        refusal = self._find_lasting_refusal(host)
        if refusal is None and self.unidentified >= self._limits.max_unidentified:
            return "more than %d connections that did not say who they are (~max_unidentified)" % (
                self._limits.max_unidentified
            )
        return refusal

    def _find_lasting_refusal(self, host: str) -> Optional[str]:
        refusal = self._find_own_refusal(host)
        if refusal is None and self._total >= self._limits.max_connections:
            return "more than %d connections (~max_connections)" % self._limits.max_connections
        return refusal

    def _find_own_refusal(self, host: str) -> Optional[str]:
        """Return why host may not connect, whatever others do."""
        limits = self._limits
        if limits.allow:
            address = ipaddress.ip_address(host.split("%", maxsplit=1)[0])
            mapped = getattr(address, "ipv4_mapped", None)
            if not any((mapped or address) in network for network in limits.allow):
                return "address not in ~allow"
        if self._by_host[host] >= limits.max_connections_per_address:
            return "more than %d connections of one address (~max_connections_per_address)" % (
                limits.max_connections_per_address
            )
        return None


class RateGuard:
    """Judges what one connection sends, over windows of RATE_WINDOW_S."""

    def __init__(self, max_packets_per_s: float, max_bytes_per_s: float, now_s: float) -> None:
        self._max_packets = max_packets_per_s * RATE_WINDOW_S
        self._max_length = max_bytes_per_s * RATE_WINDOW_S
        self._window_end_s = now_s + RATE_WINDOW_S
        self._packets = 0
        self._length = 0
        self._packets_limit = self._max_packets
        self._length_limit = self._max_length
        self._good_length = 0  # what had come when the last good packet had

    def judge(self, packets: int, length: int, now_s: float) -> Optional[str]:
        """Take the good packets and the bytes that have come since the beginning; return why it is too much, else None.

        For after each read.
        """
        if now_s >= self._window_end_s:
            self._window_end_s = now_s + RATE_WINDOW_S
            self._packets_limit = self._packets + self._max_packets
            self._length_limit = self._length + self._max_length
        if packets > self._packets:
            self._packets = packets
            self._good_length = length
        self._length = length
        if packets > self._packets_limit:
            return "more than %d packets per second (~max_packets_per_s)" % self._max_packets
        if length > self._length_limit:
            return "more than %d bytes per second (~max_bytes_per_s)" % self._max_length
        if length - self._good_length > GARBAGE_LENGTH_MAX:
            return "%d bytes without one good packet: this does not speak rosserial" % (length - self._good_length)
        return None

    @property
    def hears_garbage(self) -> bool:
        """Whether GARBAGE_REST_LENGTH bytes or more have come since the last good packet."""
        return self._length - self._good_length >= GARBAGE_REST_LENGTH
