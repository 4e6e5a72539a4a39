"""The robots' TCP connections to the driver: the only file of the simulator that touches sockets.

One selector serves all robots, which connect as the firmware does. Nothing here knows what the bytes mean.
"""

import ctypes
import errno
import os
import selectors
import socket
import struct
import sys
from typing import List, Optional, Tuple

from ..errors import OptionError
from ..robot_constants import RECEIVE_WINDOW_LENGTH

_READ_LENGTH = 65536

_MAX_UNSENT = 1 << 20
"""Bytes kept for a driver that does not read; the robot is blocked long before, so more would be a bug of ours."""

_MAX_ABANDONED = 200
"""Connections of robots that lost their power; after this many later ones the driver has given up the first one."""

# Like the ESP8266, whose own send buffer is two segments: a server that does not read is noticed soon.
_SEND_BUFFER_LENGTH = 16384

_SO_ATTACH_FILTER = 26
_DROP_ALL = struct.pack("HBBI", 0x06, 0, 0, 0)
"""Number of the socket option (asm-generic/socket.h), and the shortest packet filter: keep 0 bytes of each
(linux/filter.h: BPF_RET | BPF_K). Needs no privileges."""


class LinkHandler:
    """Callbacks on connections, robot by robot; called in connect(), send() and poll()."""

    def connection_made(self, index: int) -> None:
        """The driver accepted."""

    def connection_failed(self, index: int, reason: str) -> None:
        """A connect() had no success."""

    def connection_lost(self, index: int, reason: str) -> None:
        """The connection ended, and not by close()."""

    def receive_bytes(self, index: int, data: bytes) -> None:
        """Bytes came."""

    def writing_blocked(self, index: int) -> None:
        """The system takes no more bytes."""

    def writing_resumed(self, index: int) -> None:
        """The system took all bytes that waited."""


class _Connection:
    def __init__(self, index: int, sock: socket.socket) -> None:
        self.index = index
        self.socket = sock
        self.is_open = False
        self.unsent = bytearray()
        self.paused = False


class TcpLink:
    """The connections of all robots.

    Attributes:
        own_addresses: of each robot, as the driver sees it.
        handler: receives the events.
    """

    def __init__(self, count: int, host: str, port: int, first_number: int = 0) -> None:
        """Prepare connections of count robots to host:port; set handler before anything else.

        first_number tells the robots of several simulators on one machine apart.

        Raises: OptionError for a host that cannot be resolved.
        """
        self.host = host
        self.port = port
        self.handler = LinkHandler()
        self._selector = selectors.DefaultSelector()
        self._connections: List[Optional[_Connection]] = [None] * count
        self._abandoned: List[socket.socket] = []
        self._family, self._address = _resolve(host, port)
        self.own_addresses = [self._find_own_address(first_number + index) for index in range(count)]

    def _find_own_address(self, number: int) -> str:
        """Return the address from which robot number connects, as its boot line names it.

        To a driver on this machine each robot connects from its own address, as robots on a network do:
        127.0.1.1, 127.0.1.2, ... Where the system has only 127.0.0.1, all share that.
        """
        is_local = str(self._address[0]).startswith("127.")
        with socket.socket(self._family, socket.SOCK_DGRAM) as probe:
            try:
                if is_local:
                    own = "127.0.%d.%d" % (1 + number // 250 % 250, 1 + number % 250)
                    probe.bind((own, 0))
                    return own
                probe.connect(self._address)
                return str(probe.getsockname()[0])
            except OSError:
                # No route yet (robots report it when they connect), or a system with a single loopback address.
                return "127.0.0.1" if is_local else "0.0.0.0"

    def connect(self, index: int) -> None:
        """Begin to connect a robot; the handler receives the outcome."""
        self.close(index)
        try:
            sock = self._begin_connect(self.own_addresses[index])
        except OSError as error:
            self.handler.connection_failed(index, error.strerror or str(error))
            return
        self._connections[index] = connection = _Connection(index, sock)
        self._selector.register(sock, selectors.EVENT_WRITE, connection)

    def _begin_connect(self, own_address: str) -> socket.socket:
        """Return a socket that is being connected.

        Raises: OSError where that fails at once: refused, no route, no more files or ports.
        """
        sock = socket.socket(self._family, socket.SOCK_STREAM)
        try:
            sock.setblocking(False)
            # Linux then takes about this many unread bytes, as the robot does.
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_WINDOW_LENGTH)
            if own_address.startswith("127."):
                sock.bind((own_address, 0))
            result = sock.connect_ex(self._address)
            if result not in (0, errno.EINPROGRESS):
                raise OSError(result, os.strerror(result))
        except OSError:
            sock.close()
            raise
        return sock

    def is_connecting(self, index: int) -> bool:
        """Return whether a connect() of this robot is still under way."""
        connection = self._connections[index]
        return connection is not None and not connection.is_open

    def _find_open(self, index: int) -> Optional[_Connection]:
        connection = self._connections[index]
        return connection if connection is not None and connection.is_open else None

    def count_open(self) -> int:
        """Return how many robots have a connection."""
        return sum(self._find_open(index) is not None for index in range(len(self._connections)))

    def send(self, index: int, data: bytes) -> None:
        """Send data for a robot, later if the driver does not read now (writing_blocked())."""
        connection = self._find_open(index)
        if connection is None:
            return
        if connection.unsent:
            if len(connection.unsent) < _MAX_UNSENT:
                connection.unsent += data
            return
        sent = self._try_send(connection, data)
        if sent is not None and sent < len(data):
            connection.unsent += data[sent:]
            self._watch(connection)
            self.handler.writing_blocked(index)

    def _try_send(self, connection: _Connection, data: bytes) -> Optional[int]:
        """Return how much of data the system took, None if the connection is lost."""
        try:
            return connection.socket.send(data)
        except BlockingIOError:
            return 0
        except OSError as error:
            self._lose(connection, error.strerror or str(error))
            return None

    def has_unsent(self, index: int) -> bool:
        """Return whether bytes of a robot wait for the system to take them."""
        connection = self._find_open(index)
        return connection is not None and bool(connection.unsent)

    def drop_unsent(self, index: int) -> None:
        """Drop what could not be sent, as a write that ran into its time limit does."""
        connection = self._find_open(index)
        if connection is not None and connection.unsent:
            connection.unsent.clear()
            self._watch(connection)

    def pause(self, index: int, paused: bool) -> None:
        """Leave what arrives for a robot in the system's buffer, or read it again."""
        connection = self._find_open(index)
        if connection is not None and connection.paused != paused:
            connection.paused = paused
            self._watch(connection)

    def _watch(self, connection: _Connection) -> None:
        """Register with the selector what a connection waits for."""
        events = 0 if connection.paused else selectors.EVENT_READ
        if connection.unsent:
            events |= selectors.EVENT_WRITE
        self._forget(connection)
        if events:
            self._selector.register(connection.socket, events, connection)

    def _forget(self, connection: _Connection) -> None:
        if connection.socket in self._selector.get_map():
            self._selector.unregister(connection.socket)

    def poll(self, timeout_s: float) -> None:
        """Tell the handler what happened, after at most timeout_s."""
        for key, mask in self._selector.select(timeout_s):
            connection: _Connection = key.data
            if not connection.is_open:
                self._finish_connect(connection)
                continue
            if mask & selectors.EVENT_WRITE:
                self._flush(connection)
            if mask & selectors.EVENT_READ and self._connections[connection.index] is connection:
                self._receive(connection)

    def _finish_connect(self, connection: _Connection) -> None:
        result = connection.socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if result:
            self.close(connection.index)
            self.handler.connection_failed(connection.index, os.strerror(result))
            return
        connection.is_open = True
        connection.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_LENGTH)
        self._watch(connection)
        self.handler.connection_made(connection.index)

    def _flush(self, connection: _Connection) -> None:
        del connection.unsent[: self._try_send(connection, connection.unsent) or 0]
        if self._connections[connection.index] is connection and not connection.unsent:
            self._watch(connection)
            self.handler.writing_resumed(connection.index)

    def _receive(self, connection: _Connection) -> None:
        try:
            data = connection.socket.recv(_READ_LENGTH)
        except BlockingIOError:
            return
        except OSError as error:
            self._lose(connection, error.strerror or str(error))
            return
        if data:
            self.handler.receive_bytes(connection.index, data)
        else:
            self._lose(connection, "the driver closed")

    def _lose(self, connection: _Connection, reason: str) -> None:
        self.close(connection.index)
        self.handler.connection_lost(connection.index, reason)

    def close(self, index: int) -> None:
        """End a robot's connection, if it has one, in the orderly way (FIN)."""
        connection = self._connections[index]
        if connection is not None:
            self._connections[index] = None
            self._forget(connection)
            connection.socket.close()

    def abandon(self, index: int) -> None:
        """Leave a robot's connection without a word, as one without power does.

        The driver gets no FIN, and on Linux not even acknowledgements: what it sends stays unsent. Elsewhere the
        system keeps acknowledging until its buffer is full. The socket stays open until the program ends.
        """
        connection = self._find_open(index)
        if connection is None:
            self.close(index)
            return
        self._connections[index] = None
        self._forget(connection)
        _drop_incoming(connection.socket)
        self._abandoned.append(connection.socket)
        if len(self._abandoned) > _MAX_ABANDONED:
            self._abandoned.pop(0).close()

    def close_all(self) -> None:
        """End every connection; safe to call twice."""
        for index in range(len(self._connections)):
            self.close(index)
        for sock in self._abandoned:
            sock.close()
        self._abandoned.clear()
        self._selector.close()


def _resolve(host: str, port: int) -> Tuple[int, Tuple]:
    """Return family and address. Raises: OptionError."""
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError) as error:
        raise OptionError(f"host {host!r} cannot be resolved: {error}; give a name or an address") from error
    # IPv4 first: robots use nothing else.
    found.sort(key=lambda entry: entry[0] != socket.AF_INET)
    return found[0][0], found[0][4]


def _drop_incoming(sock: socket.socket) -> None:
    """Make the system drop every segment for this socket, so that nothing is acknowledged."""
    if not sys.platform.startswith("linux"):
        return
    drop_all = ctypes.create_string_buffer(_DROP_ALL)
    program = struct.pack("HP", 1, ctypes.addressof(drop_all))
    try:
        sock.setsockopt(socket.SOL_SOCKET, _SO_ATTACH_FILTER, program)
    except OSError:
        # A kernel built without socket filters: the peer is acknowledged, as on other systems.
        return
