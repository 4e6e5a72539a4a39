"""Reads the headers of connections (TCPROS: behind their length), each on its own thread: none can delay another."""

import contextlib
import socket
import threading
import time
from typing import Any, Callable

from ..connection_table import ConnectionTable
from ..ros_messages import LENGTH

THREAD_TRIES, THREAD_RETRY_S = 40, 0.05
"""Tries to get a thread, and s between two: one may end soon, and a program that is refused may never come again."""

HANDSHAKE, LAST_HANDSHAKE = "handshake", "handshake, last try"
"""Names of the threads; the second one tells who watches threads that a program is refused."""

HANDSHAKE_TIMEOUT_S = 5.0
"""A program sends its header as soon as it has connected."""

PENDING_MAX = 256
"""Connections whose header is not complete. One more, and the oldest of the address with the most is closed."""

HEADER_LENGTH_MAX = 65536
"""A header holds the definition of a message type; the longest of ROS's own packages is 15 kB."""

Serve = Callable[[socket.socket, Any, bytes], None]
"""Takes over a connection: its blocking socket, the address of its other end, and the header with its length."""


class ConnectionLimit:
    """At most this many connections at a time; for calls from any thread."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._lock = threading.Lock()
        self._held: ConnectionTable[socket.socket] = ConnectionTable()

    def add(self, sock: socket.socket, address: Any) -> None:
        """Hold a connection; if there are too many, shut down the oldest one of the address with the most."""
        with self._lock:
            if len(self._held) >= self._most:
                victim = self._held.list_connections(self._held.find_largest())[0]
                self._held.remove(victim)
                with contextlib.suppress(OSError):
                    victim.shutdown(socket.SHUT_RDWR)  # its own thread closes it
            self._held.add(sock, address[0])

    def remove(self, sock: socket.socket) -> bool:
        """Return whether sock was still held."""
        with self._lock:
            return self._held.remove(sock)


class HandshakeReader:
    """The threads that read headers; add() is called by the thread that accepts connections."""

    def __init__(self, serve: Serve, timeout_s: float = HANDSHAKE_TIMEOUT_S, pending_max: int = PENDING_MAX) -> None:
        """serve() is called on the connection's thread, and may block."""
        self._serve = serve
        self._timeout_s = timeout_s
        self._pending = ConnectionLimit(pending_max)

    def add(self, sock: socket.socket, address: Any) -> None:
        """Take over a connection that was just accepted from address (host, port, ...)."""
        self._pending.add(sock, address)
        for name in [HANDSHAKE] * THREAD_TRIES + [LAST_HANDSHAKE]:
            try:
                threading.Thread(target=self._run, args=(sock, address), name=name, daemon=True).start()
            except RuntimeError:
                time.sleep(THREAD_RETRY_S)
            else:
                return
        self._pending.remove(sock)
        sock.close()

    def _run(self, sock: socket.socket, address: Any) -> None:
        header = b""
        with contextlib.suppress(OSError):
            header = self._read_header(sock)
        if self._pending.remove(sock) and header:
            sock.settimeout(None)
            self._serve(sock, address, header)
        else:
            sock.close()

    def _read_header(self, sock: socket.socket) -> bytes:
        """Return a header with its length; empty: there is none. Raises: OSError: it broke, or the time is over."""
        deadline_s = time.monotonic() + self._timeout_s
        data = _read(sock, LENGTH.size, deadline_s)
        if len(data) < LENGTH.size:
            return b""
        length: int = LENGTH.unpack(data)[0]
        if not 0 < length <= HEADER_LENGTH_MAX:
            return b""
        header = _read(sock, length, deadline_s)
        return data + header if len(header) == length else b""


def _read(sock: socket.socket, length: int, deadline_s: float) -> bytes:
    """Return length bytes, fewer at the end of the connection. Raises: OSError."""
    data = b""
    while len(data) < length:
        sock.settimeout(max(0.001, deadline_s - time.monotonic()))
        part = sock.recv(length - len(data))
        if not part:
            break
        data += part
    return data
