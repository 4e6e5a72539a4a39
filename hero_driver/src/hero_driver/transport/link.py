"""One TCP connection: reads, and writes each packet with one send or keeps it until the socket takes it."""

import collections
import fcntl
import functools
import socket
import struct
import termios
from typing import Callable, Deque, NamedTuple, Optional, Protocol

READ_LENGTH = 4096
"""Read at once from one robot: two bursts, or garbage that takes 1 ms, which delays the others by no more."""

UNSENT_MAX = 65536
"""Bytes that may wait for a peer that does not read; a robot gets commands only after it has taken the last."""

_INT = struct.Struct("i")


class Address(NamedTuple):
    """The far or near end of a connection."""

    host: str
    port: int

    def __str__(self) -> str:
        return "[%s]:%d" % self if ":" in self.host else "%s:%d" % self


class LinkHandler:
    """Callbacks of the transport, always on the loop's thread; here they do nothing."""

    def open_link(self, link: "Link") -> Optional[str]:
        """A connection is open; return a reason to refuse it, or None."""

    def receive_data(self, link: "Link", data: bytes, now_s: float) -> None:
        """Take data that was read from link at now_s (monotonic)."""

    def close_link(self, link: "Link", reason: str) -> None:
        """Take note that the connection was closed, by either side; reason, for users, says why."""

    def poll(self, now_s: float) -> None:
        """Called every POLL_INTERVAL_S, before poll_link() for every other connection."""

    def poll_link(self, link: "Link", now_s: float) -> None:
        """Called every POLL_INTERVAL_S for each connection."""

    def resume(self, now_s: float) -> None:
        """The loop runs again after a pause in which it received nothing; called before anything else."""

    def report_bug(self, error: Exception) -> None:
        """One of the calls above, or one made for the loop, raised error; the loop continues."""

    def stop_at_end(self) -> None:
        """The loop has ended, or has broken: stop what moves at the other ends before they are closed; may block."""

    def warn_network(self, text: str) -> None:
        """Something about the network that the user should know."""


class LinkOwner(Protocol):
    """Interface of the loop that owns a link."""

    def call_soon(self, call: Callable[[], None]) -> None:
        """Run call on the loop's thread, soon; from any thread."""

    def watch(self, link: "Link") -> None:
        """Wait for what link needs now: to be read, to be written, or both."""

    def close_link(self, link: "Link", reason: str) -> None:
        """Close link and tell the handler; safe to call twice."""


class Link:
    """One TCP connection to one robot."""

    def __init__(self, loop: LinkOwner, sock: socket.socket, address: Address) -> None:
        """loop reads and writes sock, which is connected to address and does not block."""
        self.address = address
        self.closed = False
        self.handed_length = 0  # bytes of all packets given to send_packet()
        self.received_length = 0  # bytes of all that read() has returned
        self._loop = loop
        self._socket = sock
        # Acknowledged at once, odometry of robots whose TCP delays small writes has a p50 of 0.3 instead of 8.9 ms.
        self._acknowledge = functools.partial(sock.setsockopt, socket.IPPROTO_TCP, socket.TCP_QUICKACK, 1)
        self._unsent: Deque[bytes] = collections.deque()
        self._unsent_length = 0

    def send_packet(self, packet: bytes) -> None:
        """Write one whole packet with one send, or keep it until the socket takes it."""
        if self.closed:
            return
        self.handed_length += len(packet)
        if self._unsent:
            self._keep(packet)
            return
        remainder = self._write(packet)
        if remainder:
            self._keep(remainder)
            self._loop.watch(self)

    def read_unacknowledged_length(self) -> int:
        """Return how many bytes of packets the peer's TCP has not acknowledged."""
        if self.closed:
            return 0
        # A writable buffer is answered in a third of the time. SIOCOUTQ has the number of TIOCOUTQ (tcp(7)).
        answer = bytearray(_INT.size)
        fcntl.ioctl(self._socket.fileno(), termios.TIOCOUTQ, answer)
        length: int = _INT.unpack(answer)[0]
        return length + self._unsent_length

    def close(self, reason: str) -> None:
        """Close the connection; safe to call twice."""
        self._loop.close_link(self, reason)

    def fileno(self) -> int:
        """Return the socket's file descriptor."""
        return self._socket.fileno()

    @property
    def is_full(self) -> bool:
        """Return whether packets wait until the socket takes them."""
        return bool(self._unsent)

    def read(self) -> bytes:
        """Return what has come, nothing if there is nothing; close at the end of the stream and where it broke."""
        try:
            data = self._socket.recv(READ_LENGTH)
            if data:
                # At once, not within 40 ms: a robot's TCP holds the remainder of a burst back until its beginning is
                # acknowledged (Nagle). Holds for this time only; the kernel falls back by itself (tcp(7)).
                self._acknowledge()
        except (BlockingIOError, InterruptedError):
            return b""
        except OSError as error:
            self.close(f"read failed: {describe_error(error)}")
            return b""
        if not data:
            self.close("closed by the robot")
        self.received_length += len(data)
        return data

    def flush(self) -> None:
        """Write what is left over, as far as the socket takes it."""
        while self._unsent:
            remainder = self._write(self._unsent[0])
            self._unsent_length -= len(self._unsent[0]) - len(remainder)
            if remainder:
                self._unsent[0] = remainder
                return
            self._unsent.popleft()

    def discard(self) -> None:
        """Close the socket itself; only the loop calls this."""
        self.closed = True
        self._unsent.clear()
        self._unsent_length = 0
        self._socket.close()

    def _keep(self, data: bytes) -> None:
        if self._unsent_length + len(data) > UNSENT_MAX:
            self._close_soon("it does not read: %d bytes wait for it" % self._unsent_length)
            return
        self._unsent.append(data)
        self._unsent_length += len(data)

    def _close_soon(self, reason: str) -> None:
        """Close, but not at once: the caller is still busy with this link."""
        self._loop.call_soon(lambda: self.close(reason))

    def _write(self, data: bytes) -> bytes:
        """Return what the socket did not take."""
        try:
            sent = self._socket.send(data)
        except (BlockingIOError, InterruptedError):
            return data
        except OSError as error:
            self._close_soon(f"write failed: {describe_error(error)}")
            return b""
        return data[sent:]


def describe_error(error: OSError) -> str:
    """Return what went wrong, in the system's words."""
    return error.strerror or str(error)
