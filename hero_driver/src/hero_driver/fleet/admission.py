"""Limits on untrusted peers: the address allow-list, caps on connections, token buckets for bytes and names. Pure."""

import ipaddress
from dataclasses import dataclass
from typing import Any, Optional, Tuple, Union

from hero_node import ConnectionTable, TokenBucket, TokenBuckets
from hero_node.parameters import Parameter, declare, make_error, whole_number

Network = Union[ipaddress.IPv4Network, ipaddress.IPv6Network]

GARBAGE_BURST_LENGTH = 65536
"""Bytes outside of packets that one address may send at once: a truncated packet has less than 1 kB."""

GARBAGE_PER_S = 16384.0
"""Bytes outside of packets that one address may send per second after that."""

NEW_ROBOTS_PER_S = 5.0
"""New robots of one address per second, after as many as it may have connections: each is 20 calls to the master."""


def _read_networks(name: str, value: Any) -> Tuple[Network, ...]:
    allowed = "a list of networks such as 10.42.0.0/24"
    if not isinstance(value, (list, tuple)) or not all(isinstance(entry, str) for entry in value):
        raise make_error(name, value, allowed)
    networks = []
    for entry in value:
        try:
            networks.append(ipaddress.ip_network(entry))
        except ValueError as error:
            raise make_error(name, entry, f"{allowed} ({error})") from error
    return tuple(networks)


@dataclass(frozen=True)
class AdmissionLimits:
    """Parameters that limit connections."""

    allow: Tuple[Network, ...] = declare(
        Parameter((), _read_networks, "networks (CIDR) that robots may connect from; empty: all")
    )
    max_connections: int = declare(whole_number(400, 1, 5000, "", "connections in total"))
    max_connections_per_address: int = declare(whole_number(400, 1, 5000, "", "connections per address"))
    max_unidentified: int = declare(whole_number(200, 1, 5000, "", "connections that have not identified themselves"))
    max_packets_per_s: int = declare(whole_number(5000, 10, 1000000, "1/s", "packets per robot; stock robots send 211"))
    max_bytes_per_s: int = declare(
        whole_number(2000000, 1000, 100000000, "bytes/s", "bytes per robot; stock robots send 44051")
    )


class Admission:
    """Counts what each address has and sends, and finds what exceeds the limits."""

    def __init__(self, limits: AdmissionLimits) -> None:
        """limits: the driver's parameters."""
        self._limits = limits
        self._connected: ConnectionTable[Any] = ConnectionTable()
        self._unidentified: ConnectionTable[Any] = ConnectionTable()
        self._new_robots = TokenBuckets(limits.max_connections_per_address, NEW_ROBOTS_PER_S)
        self._garbage = TokenBuckets(GARBAGE_BURST_LENGTH, GARBAGE_PER_S)

    def admit(self, connection: Any, host: str) -> Optional[str]:
        """Count a connection from host, of any type; return why it is refused, None if it may stay."""
        limits = self._limits
        refusal = self._find_own_refusal(host)
        if refusal is None and len(self._connected) >= limits.max_connections:
            refusal = "more than %d connections (~max_connections)" % limits.max_connections
        if refusal is None and len(self._unidentified) >= limits.max_unidentified:
            refusal = "more than %d unidentified connections (~max_unidentified)" % limits.max_unidentified
        if refusal is None:
            self._connected.add(connection, host)
            self._unidentified.add(connection, host)
        return refusal

    def find_eviction(self, host: str) -> Optional[Tuple[Any, str]]:
        """Return the connection that has to end for one of host's, and the parameter that demands it.

        It is of the address with the most: the oldest unidentified one, else the newest. None while there is room, or
        where no address has more than host would have: so no address can keep others out.
        """
        if self._find_own_refusal(host) is not None:
            return None
        for table, most, parameter in (
            (self._connected, self._limits.max_connections, "~max_connections"),
            (self._unidentified, self._limits.max_unidentified, "~max_unidentified"),
        ):
            if len(table) >= most:
                largest = table.find_largest()
                if table.count(largest) <= table.count(host) + 1:
                    return None
                unidentified = self._unidentified.list_connections(largest)
                return (unidentified or self._connected.list_connections(largest)[-1:])[0], parameter
        return None

    def note_identified(self, connection: Any) -> None:
        """A connection has said which robot it is."""
        self._unidentified.remove(connection)

    def release(self, connection: Any) -> None:
        """An admitted connection is closed."""
        self._connected.remove(connection)
        self._unidentified.remove(connection)

    def admit_new_robot(self, host: str, now_s: float) -> Optional[str]:
        """Count a new robot of host, which costs calls to the master; return why it has to wait, or None."""
        if self._new_robots.take(host, 1.0, now_s):
            return None
        most = self._limits.max_connections_per_address
        return "more than %d new robots from one address, and %g more per second" % (most, NEW_ROBOTS_PER_S)

    def admit_garbage(self, host: str, length: int, now_s: float) -> Optional[str]:
        """Count bytes of host that belong to no packet; return why its connection has to end, None if it may stay."""
        if self._garbage.take(host, length, now_s):
            return None
        return "its address sends too many bytes outside of packets: this does not speak rosserial"

    def _find_own_refusal(self, host: str) -> Optional[str]:
        """Return why host may not connect, whatever others do."""
        limits = self._limits
        if limits.allow:
            address = ipaddress.ip_address(host.split("%", maxsplit=1)[0])
            mapped = getattr(address, "ipv4_mapped", None)
            if not any((mapped or address) in network for network in limits.allow):
                return "address not in ~allow"
        if self._connected.count(host) >= limits.max_connections_per_address:
            text = "more than %d connections of one address (~max_connections_per_address)"
            return text % limits.max_connections_per_address
        return None


class RateLimit:
    """Limits of one connection's packets and bytes per second; at once it may use those of one second."""

    def __init__(self, limits: AdmissionLimits, now_s: float) -> None:
        """Begin at now_s (monotonic) with nothing counted."""
        self._packets = TokenBucket(limits.max_packets_per_s, limits.max_packets_per_s, now_s)
        self._bytes = TokenBucket(limits.max_bytes_per_s, limits.max_bytes_per_s, now_s)

    def admit(self, packets: int, length: int, now_s: float) -> Optional[str]:
        """Count what one read brought; return why it is too much, None if it is not."""
        if not self._packets.take(packets, now_s):
            return "more than %d packets per second (~max_packets_per_s)" % self._packets.burst
        if not self._bytes.take(length, now_s):
            return "more than %d bytes per second (~max_bytes_per_s)" % self._bytes.burst
        return None
