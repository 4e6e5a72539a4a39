"""Open connections by address, for limits that one address cannot exhaust at the cost of others. Pure."""

import collections
from typing import Counter, Dict, Generic, Iterator, List, TypeVar

Connection = TypeVar("Connection")


class ConnectionTable(Generic[Connection]):
    """Connections with the address of the other end of each, the oldest first."""

    def __init__(self) -> None:
        self._addresses: Dict[Connection, str] = {}
        self._counts: Counter[str] = collections.Counter()

    def __len__(self) -> int:
        return len(self._addresses)

    def __iter__(self) -> Iterator[Connection]:
        return iter(self._addresses)

    def add(self, connection: Connection, address: str) -> None:
        """Note a new connection."""
        self._addresses[connection] = address
        self._counts[address] += 1

    def remove(self, connection: Connection) -> bool:
        """Forget a connection; return whether it was here."""
        address = self._addresses.pop(connection, None)
        if address is None:
            return False
        self._counts[address] -= 1
        if not self._counts[address]:
            del self._counts[address]
        return True

    def count(self, address: str) -> int:
        """Return the number of connections of an address."""
        return self._counts[address]

    def list_connections(self, address: str) -> List[Connection]:
        """Return the connections of an address, the oldest first."""
        return [connection for connection, known in self._addresses.items() if known == address]

    def find_largest(self) -> str:
        """Return the address with the most connections. Raises: IndexError without connections."""
        return self._counts.most_common(1)[0][0]
