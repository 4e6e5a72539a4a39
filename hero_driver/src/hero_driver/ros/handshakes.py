"""Reads the connection headers of programs that connect, all on one thread, none of which can hold up another.

TCPROS: a program that connects sends a 32-bit length and a connection header of that length, then it waits for the
answer. Knows no ROS: what is complete goes to serve().
"""

import collections
import contextlib
import functools
import os
import selectors
import socket
import struct
import threading
import time
from typing import Any, Callable, Counter, Deque, Dict, Optional, Tuple

HANDSHAKE_TIMEOUT_S = 5.0
"""A program sends its header as soon as it has connected."""

PENDING_MAX = 256
"""Connections whose header is not complete. One more, and the oldest of the address with the most is closed."""

HEADER_LENGTH_MAX = 65536
"""A header holds the definition of a message type; the longest of ROS's own packages is 15 kB."""

_LENGTH = struct.Struct("<I")

Serve = Callable[[socket.socket, Any, bytes], None]
"""Takes over a connection: its socket, which blocks, the address of its other end, and the header with its length."""


class _Pending:
    """A connection whose header is not complete."""

    def __init__(self, sock: socket.socket, address: Any, deadline_s: float) -> None:
        self.socket = sock
        self.address = address
        self.deadline_s = deadline_s
        self.data = b""
        self.length = _LENGTH.size

    def read(self) -> Optional[bool]:
        """Return whether the header is complete, None where the connection has ended or sends something else.

        Nothing behind the header is read: it is left to the one who is served.
        """
        try:
            data = self.socket.recv(self.length - len(self.data))
        except (BlockingIOError, InterruptedError):
            return False
        except OSError:
            return None
        if not data:
            return None
        self.data += data
        if len(self.data) == _LENGTH.size and self.length == _LENGTH.size:
            length: int = _LENGTH.unpack(self.data)[0]
            if not 0 < length <= HEADER_LENGTH_MAX:
                return None
            self.length += length
        return len(self.data) == self.length


class HandshakeReader:
    """One thread that reads headers; add() is called by the thread that accepts connections."""

    def __init__(self, serve: Serve, timeout_s: float = HANDSHAKE_TIMEOUT_S, pending_max: int = PENDING_MAX) -> None:
        """serve() is called on a thread of its own for each connection, so that it may block."""
        self._serve = serve
        self._timeout_s = timeout_s
        self._pending_max = pending_max
        self._accepted: Deque[Tuple[socket.socket, Any]] = collections.deque()
        self._pending: Dict[int, _Pending] = {}  # by file; the oldest first
        self._selector = selectors.DefaultSelector()
        self._wake_read, self._wake_write = os.pipe()
        os.set_blocking(self._wake_read, False)
        os.set_blocking(self._wake_write, False)
        self._selector.register(self._wake_read, selectors.EVENT_READ)
        self._running = True
        self._thread = threading.Thread(target=self._run, name="handshakes", daemon=True)

    def open(self) -> None:
        """Begin to read."""
        self._thread.start()

    def close(self) -> None:
        """Close the connections that wait and end the thread; safe to call twice."""
        self._running = False
        if self._thread.is_alive():
            self._wake()
            self._thread.join()

    def add(self, sock: socket.socket, address: Any) -> None:
        """Take over a connection that was just accepted from address (host, port, ...)."""
        if not self._running:
            sock.close()
            return
        self._accepted.append((sock, address))
        self._wake()

    def _wake(self) -> None:
        # A pipe that is full wakes the thread too.
        with contextlib.suppress(BlockingIOError):
            os.write(self._wake_write, b"\0")

    def _run(self) -> None:
        try:
            while self._running:
                for key, _ in self._selector.select(self._find_wait_s()):
                    if key.data is None:
                        self._take_accepted()
                    elif self._pending.get(key.fd) is key.data:
                        self._read(key.data)
                self._close_expired()
        finally:
            for pending in list(self._pending.values()):
                self._forget(pending).close()
            while self._accepted:
                self._accepted.popleft()[0].close()
            self._selector.close()
            os.close(self._wake_read)
            os.close(self._wake_write)

    def _find_wait_s(self) -> Optional[float]:
        oldest = next(iter(self._pending.values()), None)
        return None if oldest is None else max(0.0, oldest.deadline_s - time.monotonic())

    def _take_accepted(self) -> None:
        os.read(self._wake_read, 4096)
        while self._accepted:
            sock, address = self._accepted.popleft()
            if len(self._pending) >= self._pending_max:
                self._evict()
            sock.setblocking(False)
            pending = _Pending(sock, address, time.monotonic() + self._timeout_s)
            self._pending[sock.fileno()] = pending
            self._selector.register(sock, selectors.EVENT_READ, pending)

    def _evict(self) -> None:
        counts: Counter[str] = collections.Counter(pending.address[0] for pending in self._pending.values())
        most = counts.most_common(1)[0][0]
        self._forget(next(p for p in self._pending.values() if p.address[0] == most)).close()

    def _read(self, pending: _Pending) -> None:
        is_complete = pending.read()
        if is_complete is None:
            self._forget(pending).close()
        elif is_complete:
            self._start_serving(self._forget(pending), pending)

    def _start_serving(self, sock: socket.socket, pending: _Pending) -> None:
        sock.setblocking(True)
        call = functools.partial(self._serve, sock, pending.address, pending.data)
        try:
            threading.Thread(target=call, name="handshake", daemon=True).start()
        except RuntimeError:
            # The system has no thread left: the next connection may get one.
            sock.close()

    def _close_expired(self) -> None:
        now_s = time.monotonic()
        while self._pending:
            oldest = next(iter(self._pending.values()))
            if oldest.deadline_s > now_s:
                return
            self._forget(oldest).close()

    def _forget(self, pending: _Pending) -> socket.socket:
        del self._pending[pending.socket.fileno()]
        self._selector.unregister(pending.socket)
        return pending.socket
