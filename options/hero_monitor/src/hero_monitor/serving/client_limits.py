"""Limits for connections: untrusted clients cannot lock out those who are logged in. Pure.

A connection is trusted once a request with a login has arrived on it. A new connection always gets in while
an untrusted one can be evicted for it: one of its own address when that address has too many, else one of the address
with the most. Times enter as now_s, any clock that never steps.
"""

import ipaddress
from typing import Any, Dict

from hero_node import ConnectionTable

Connection = Any
"""An IOStream of tornado: close(), closed()."""

CONNECTIONS_MAX = 400
UNTRUSTED_PER_ADDRESS_MAX = 50
"""Untrusted connections of one address. Each is served one request per turn of the loop, however many it sends."""

UNTRUSTED_S = 10.0
"""An untrusted connection is closed after this time: a login takes one request, and the request one second."""


def group_address(address: str) -> str:
    """Return what limits count as one address: an IPv4 address, or the /64 network that an IPv6 host has to itself."""
    try:
        parsed = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if isinstance(parsed, ipaddress.IPv4Address):
        return str(parsed)
    if parsed.ipv4_mapped is not None:
        return str(parsed.ipv4_mapped)
    return str(ipaddress.ip_network((parsed, 64), strict=False))


class ClientLimits:
    """The open connections of one server."""

    def __init__(self, connections_max: int, per_address_max: int = UNTRUSTED_PER_ADDRESS_MAX) -> None:
        """per_address_max: of untrusted connections."""
        self._connections_max = connections_max
        self._per_address_max = per_address_max
        self._opened_s: Dict[Connection, float] = {}  # of all, the oldest first
        self._untrusted: ConnectionTable[Connection] = ConnectionTable()

    def admit(self, connection: Connection, address: str, now_s: float) -> bool:
        """Take a new connection, evicting another if need be; return False if all others are trusted."""
        for known in [known for known in self._opened_s if known.closed()]:
            self._forget(known)
        address = group_address(address)
        if self._untrusted.count(address) >= self._per_address_max:
            self._evict_oldest_of(address)
        elif len(self._opened_s) >= self._connections_max:
            if not self._untrusted:
                return False
            self._evict_oldest_of(self._untrusted.find_largest())
        self._untrusted.add(connection, address)
        self._opened_s[connection] = now_s
        return True

    def _evict_oldest_of(self, address: str) -> None:
        oldest = self._untrusted.list_connections(address)[0]
        self._forget(oldest)
        oldest.close()

    def _forget(self, connection: Connection) -> None:
        del self._opened_s[connection]
        self._untrusted.remove(connection)

    def trust(self, connection: Connection) -> None:
        """Exempt a connection on which a request with a login has arrived."""
        self._untrusted.remove(connection)

    def expire(self, now_s: float) -> None:
        """Close untrusted connections that are too old; to be called about once a second."""
        for connection in self._untrusted:
            if now_s - self._opened_s[connection] > UNTRUSTED_S:
                connection.close()
