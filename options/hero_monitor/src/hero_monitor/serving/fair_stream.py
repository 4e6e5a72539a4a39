"""A connection that cannot keep the server from others: its input is read in turns, what it leaves unread is bounded.

tornado reads the frames of a WebSocket in a loop that returns to others only when no more input has arrived: a client
that sends without a pause, be it pings, would be the only one that is served.
"""

import asyncio
import time
from typing import Any, Awaitable, Optional

import tornado.iostream

TURN_S = 0.001
"""Work for one client, after which others have their turn."""

REST_FACTOR = 3.0
"""A client that used up its turn is read again after this many times the work: it gets a quarter of the loop."""

REST_MAX_S = 0.05
"""One request that drives a thousand robots takes 40 ms, and comes every 100 ms."""

UNREAD_WRITES_MAX = 1000
"""Writes that wait for a client; beyond them it is closed.

Few wait for one that reads: updates are written one at a time, only answers and pongs whenever the client asks.
"""


class FairStream(tornado.iostream.IOStream):
    """A connection that is read in turns."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._resumed_s = time.monotonic()
        self._used_s = 0.0
        self._unread_writes = 0

    def read_bytes(self, num_bytes: int, partial: bool = False) -> Awaitable[bytes]:
        """Read when it is this client's turn."""
        return self._read_in_turn(super().read_bytes(num_bytes, partial=partial))

    def read_until_regex(self, regex: bytes, max_bytes: Optional[int] = None) -> Awaitable[bytes]:
        """Read when it is this client's turn."""
        return self._read_in_turn(super().read_until_regex(regex, max_bytes=max_bytes))

    async def _read_in_turn(self, reading: Awaitable[bytes]) -> bytes:
        # Since the last read the loop has worked for this client alone.
        self._used_s += time.monotonic() - self._resumed_s
        if self._used_s >= TURN_S:
            await asyncio.sleep(min(REST_MAX_S, REST_FACTOR * self._used_s))
            self._used_s = 0.0
        content = await reading
        self._resumed_s = time.monotonic()
        return content

    def write(self, data: Any) -> Any:
        """Write, or close the connection of a client that does not read."""
        if self._unread_writes >= UNREAD_WRITES_MAX:
            self.close()
        writing: Any = super().write(data)
        if not writing.done():
            self._unread_writes += 1
            writing.add_done_callback(self._count_read)
        return writing

    def _count_read(self, _writing: Any) -> None:
        self._unread_writes -= 1
