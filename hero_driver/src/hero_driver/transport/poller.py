"""Waits until files can be read or written: select.epoll where there is one, else select.poll.

The standard library's selectors do the same, but what they add in Python is a twentieth of all that the driver does.
"""

import math
import select
from typing import Any, Callable, Dict, List, Optional, Tuple

READ = select.POLLIN
WRITE = select.POLLOUT

Serve = Callable[[int], None]
"""Called with what a file is ready for: READ, WRITE, both, or neither where it has broken."""


class Poller:
    """The files that one thread waits for, by their descriptors.

    Attributes:
        serves: what to call for each descriptor.
        wait: takes the time (s) after which to return at the latest, None: for ever; returns descriptors that are
            ready, each with its mask. One that is closed while others are served is in serves no more, or belongs to
            another file that may not be ready.
    """

    def __init__(self) -> None:
        self.serves: Dict[int, Serve] = {}
        self._has_epoll = hasattr(select, "epoll")
        # Both have the same methods and numbers, except for the unit of time and a close().
        self._poll: Any = select.epoll() if self._has_epoll else select.poll()
        self.wait: Callable[[Optional[float]], List[Tuple[int, int]]] = (
            self._poll.poll if self._has_epoll else self._wait_ms
        )

    def register(self, descriptor: int, mask: int, serve: Serve) -> None:
        """Wait for what mask says."""
        self._poll.register(descriptor, mask)
        self.serves[descriptor] = serve

    def modify(self, descriptor: int, mask: int) -> None:
        """Wait for what mask says instead."""
        self._poll.modify(descriptor, mask)

    def unregister(self, descriptor: int) -> None:
        """Wait for descriptor no more; for before it is closed."""
        self._poll.unregister(descriptor)
        del self.serves[descriptor]

    def close(self) -> None:
        """Give the system's file back."""
        if self._has_epoll:
            self._poll.close()

    def _wait_ms(self, timeout_s: Optional[float]) -> List[Tuple[int, int]]:
        events: List[Tuple[int, int]] = self._poll.poll(None if timeout_s is None else math.ceil(1e3 * timeout_s))
        return events
