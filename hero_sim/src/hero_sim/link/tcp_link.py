"""Robots <-> the driver over TCP: the only file of the simulator that touches sockets.

One selector serves all robots. Robots dial the driver as the firmware does, or, as servers, await it on one
port each. Nothing here knows what the bytes mean.
"""

import ctypes
import errno
import os
import selectors
import socket
import struct
import sys
from typing import Dict, List, NamedTuple, Optional, Tuple

from ..errors import OptionError
from ..robot_constants import RECEIVE_WINDOW_LENGTH

MADE = "made"
FAILED = "failed"
LOST = "lost"
DATA = "data"
BLOCKED = "blocked"
UNBLOCKED = "unblocked"

_READ_LENGTH = 65536
_MOST_UNSENT = 1 << 20
"""Bytes kept for a driver that does not read; the robot stands still by then, so more means a fault of
ours."""

_MOST_ABANDONED = 200
"""Connections of robots that lost their power; by so many later ones the driver has given the first one up."""

# Like the ESP8266, whose own send buffer is two segments: a server that does not read is felt soon.
_SEND_BUFFER_LENGTH = 16384

_SO_ATTACH_FILTER = 26
_DROP_ALL = struct.pack("HBBI", 0x06, 0, 0, 0)
"""Number of the socket option (asm-generic/socket.h), and the shortest packet filter: keep 0 bytes of each
(linux/filter.h: BPF_RET | BPF_K). Needs no privileges."""


class LinkEvent(NamedTuple):
    """What happened to the connection of one robot."""

    robot_index: int
    kind: str
    data: bytes = b""  # received bytes, or the reason in words


class _Connection:
    def __init__(self, index: int, sock: socket.socket, dialling: bool) -> None:
        self.index = index
        self.socket = sock
        self.dialling = dialling
        self.unsent = bytearray()
        self.paused = False


class TcpLink:
    """The connections of all robots.

    Attributes:
        own_addresses: of each robot, as the driver sees it.
    """

    def __init__(self, count: int, host: str, port: int, serve: bool = False, first_number: int = 0) -> None:
        """Dial host:port for each of count robots, or, with serve, listen on port, port + 1, ...

        first_number tells the robots of several simulators on one machine apart.

        Raises: OptionError for a host that cannot be resolved or a port that cannot be listened on.
        """
        self.host = host
        self.port = port
        self.serve = serve
        self._selector = selectors.DefaultSelector()
        self._connections: List[Optional[_Connection]] = [None] * count
        self._listeners: Dict[int, socket.socket] = {}
        self._abandoned: List[socket.socket] = []
        self._events: List[LinkEvent] = []
        self._address = self._resolve(host, port)
        self.own_addresses = [self._find_own_address(first_number + index) for index in range(count)]
        if serve:
            for index in range(count):
                self._listen(index, port + index)

    @staticmethod
    def _resolve(host: str, port: int) -> Tuple[int, Tuple]:
        try:
            found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
        except (OSError, UnicodeError) as error:
            raise OptionError(
                "host %r cannot be resolved: %s; give a name or an address" % (host, error)
            ) from error
        # IPv4 first: robots know nothing else.
        found.sort(key=lambda entry: entry[0] != socket.AF_INET)
        return found[0][0], found[0][4]

    def _listen(self, index: int, port: int) -> None:
        family, address = self._resolve(self.host, port)
        listener = socket.socket(family, socket.SOCK_STREAM)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        # What is accepted inherits it.
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_WINDOW_LENGTH)
        try:
            listener.bind(address)
            listener.listen(4)
        except OSError as error:
            listener.close()
            self.close_all()
            raise OptionError(
                "cannot listen on %s:%d for robot %d: %s; choose another --serve PORT"
                % (self.host, port, index, error.strerror)
            ) from error
        listener.setblocking(False)
        self._listeners[index] = listener
        self._selector.register(listener, selectors.EVENT_READ, index)

    def _find_own_address(self, number: int) -> str:
        """Return the address from which robot number dials, as its boot line names it.

        To a driver on this machine each robot dials from an address of its own, as robots on a network do:
        127.0.1.1, 127.0.1.2, ... Where the system has only 127.0.0.1, all share that.
        """
        family, address = self._address
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            try:
                if family == socket.AF_INET and str(address[0]).startswith("127.") and not self.serve:
                    own = "127.0.%d.%d" % (1 + number // 250 % 250, 1 + number % 250)
                    probe.bind((own, 0))
                    return own
                probe.connect(address)
                return str(probe.getsockname()[0])
            except OSError:
                # No way there yet (robots say so when they dial), or a system with a single loopback address.
                return "127.0.0.1" if str(address[0]).startswith("127.") else "0.0.0.0"

    def dial(self, index: int) -> None:
        """Begin to connect a robot; poll() tells how it went."""
        self.close(index)
        try:
            sock = self._begin_connect(self.own_addresses[index])
        except OSError as error:
            self._events.append(LinkEvent(index, FAILED, (error.strerror or str(error)).encode()))
            return
        self._connections[index] = _Connection(index, sock, dialling=True)
        self._selector.register(sock, selectors.EVENT_WRITE, self._connections[index])

    def _begin_connect(self, own_address: str) -> socket.socket:
        """Return a socket that is being connected.

        Raises: OSError where that fails at once: refused, no route, no more files or ports.
        """
        family, address = self._address
        sock = socket.socket(family, socket.SOCK_STREAM)
        try:
            sock.setblocking(False)
            # Linux then takes about so many bytes that nobody reads, as the robot does.
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_WINDOW_LENGTH)
            if own_address.startswith("127."):
                sock.bind((own_address, 0))
            result = sock.connect_ex(address)
            if result not in (0, errno.EINPROGRESS):
                raise OSError(result, os.strerror(result))
        except OSError:
            sock.close()
            raise
        return sock

    def is_dialling(self, index: int) -> bool:
        """Return whether a dial() of this robot is still under way."""
        connection = self._connections[index]
        return connection is not None and connection.dialling

    def is_open(self, index: int) -> bool:
        """Return whether a robot has a connection."""
        connection = self._connections[index]
        return connection is not None and not connection.dialling

    def has_unsent(self, index: int) -> bool:
        """Return whether the driver has not taken all that a robot sent."""
        connection = self._connections[index]
        return connection is not None and bool(connection.unsent)

    def send(self, index: int, data: bytes) -> None:
        """Send data for a robot, later if the driver does not read now (poll() reports BLOCKED)."""
        connection = self._connections[index]
        if connection is None or connection.dialling:
            return
        if connection.unsent:
            if len(connection.unsent) < _MOST_UNSENT:
                connection.unsent += data
            return
        try:
            sent = connection.socket.send(data)
        except BlockingIOError:
            sent = 0
        except OSError as error:
            self._lose(connection, error)
            return
        if sent < len(data):
            connection.unsent += data[sent:]
            self._watch(connection)
            self._events.append(LinkEvent(index, BLOCKED))

    def drop_unsent(self, index: int) -> None:
        """Forget what could not be sent, as a write that ran into its time limit does."""
        connection = self._connections[index]
        if connection is not None and connection.unsent:
            connection.unsent.clear()
            self._watch(connection)

    def pause(self, index: int, paused: bool) -> None:
        """Leave what comes for a robot to the system's buffer, or read it again."""
        connection = self._connections[index]
        if connection is not None and not connection.dialling and connection.paused != paused:
            connection.paused = paused
            self._watch(connection)

    def _watch(self, connection: _Connection) -> None:
        """Tell the selector what a connection waits for."""
        events = 0 if connection.paused else selectors.EVENT_READ
        if connection.unsent:
            events |= selectors.EVENT_WRITE
        self._forget(connection)
        if events:
            self._selector.register(connection.socket, events, connection)

    def poll(self, timeout_s: float) -> List[LinkEvent]:
        """Return what happened, after at most timeout_s."""
        if self._events:
            timeout_s = 0.0
        for key, mask in self._selector.select(timeout_s):
            if isinstance(key.data, int):
                self._accept(key.data)
                continue
            connection = key.data
            if connection.dialling:
                self._finish_dial(connection)
                continue
            if mask & selectors.EVENT_WRITE:
                self._flush(connection)
            if mask & selectors.EVENT_READ and self._connections[connection.index] is connection:
                self._receive(connection)
        events, self._events = self._events, []
        return events

    def _accept(self, index: int) -> None:
        try:
            sock, _ = self._listeners[index].accept()
        except OSError:
            # The caller gave up before we looked; the listener is as good as before.
            return
        if self._connections[index] is not None:
            # One client at a time. The newest wins: the older one may be dead without our knowledge.
            self.close(index)
            self._events.append(LinkEvent(index, LOST, b"another client came"))
        self._open(_Connection(index, sock, dialling=False))

    def _open(self, connection: _Connection) -> None:
        connection.dialling = False
        sock = connection.socket
        sock.setblocking(False)
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_LENGTH)
        self._connections[connection.index] = connection
        self._watch(connection)
        self._events.append(LinkEvent(connection.index, MADE))

    def _finish_dial(self, connection: _Connection) -> None:
        result = connection.socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if result:
            self.close(connection.index)
            self._events.append(LinkEvent(connection.index, FAILED, errno_text(result)))
        else:
            self._open(connection)

    def _forget(self, connection: _Connection) -> None:
        if connection.socket in self._selector.get_map():
            self._selector.unregister(connection.socket)

    def _flush(self, connection: _Connection) -> None:
        try:
            sent = connection.socket.send(connection.unsent)
        except BlockingIOError:
            return
        except OSError as error:
            self._lose(connection, error)
            return
        del connection.unsent[:sent]
        if not connection.unsent:
            self._watch(connection)
            self._events.append(LinkEvent(connection.index, UNBLOCKED))

    def _receive(self, connection: _Connection) -> None:
        try:
            data = connection.socket.recv(_READ_LENGTH)
        except BlockingIOError:
            return
        except OSError as error:
            self._lose(connection, error)
            return
        if data:
            self._events.append(LinkEvent(connection.index, DATA, data))
        else:
            self.close(connection.index)
            self._events.append(LinkEvent(connection.index, LOST, b"the driver closed"))

    def _lose(self, connection: _Connection, error: OSError) -> None:
        self.close(connection.index)
        self._events.append(LinkEvent(connection.index, LOST, (error.strerror or str(error)).encode()))

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
        system goes on acknowledging until its buffer is full. The socket stays open until the program ends.
        """
        connection = self._connections[index]
        if connection is not None:
            self._connections[index] = None
            self._forget(connection)
            if connection.dialling:
                connection.socket.close()
            else:
                _make_deaf(connection.socket)
                self._abandoned.append(connection.socket)
                if len(self._abandoned) > _MOST_ABANDONED:
                    self._abandoned.pop(0).close()

    def close_all(self) -> None:
        """End every connection; safe to call twice."""
        for index in range(len(self._connections)):
            self.close(index)
        for sock in list(self._listeners.values()) + self._abandoned:
            sock.close()
        self._listeners.clear()
        self._abandoned.clear()
        self._selector.close()


def _make_deaf(sock: socket.socket) -> None:
    """Let the system drop every segment for this socket unseen, so that nothing is acknowledged."""
    if not sys.platform.startswith("linux"):
        return
    drop_all = ctypes.create_string_buffer(_DROP_ALL)
    program = struct.pack("HP", 1, ctypes.addressof(drop_all))
    try:
        sock.setsockopt(socket.SOL_SOCKET, _SO_ATTACH_FILTER, program)
    except OSError:
        # A kernel built without socket filters: the peer is acknowledged, as on other systems.
        return


def errno_text(code: int) -> bytes:
    """Return the words for an error number of the operating system."""
    return os.strerror(code).encode()
