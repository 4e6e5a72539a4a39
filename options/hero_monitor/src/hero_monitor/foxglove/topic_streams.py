"""Connections to publishers of topics, read when the web server is ready for it: one thread for all of them.

rospy reads each publisher on a thread of its own, and waking it costs several times what a message costs.
Source: ROS TCPROS and Slave API.
"""

import contextlib
import errno
import selectors
import socket
import xmlrpc.client
from http.client import HTTPException
from io import BytesIO
from typing import Any, Dict, List, NamedTuple
from urllib.parse import urlsplit
from xml.parsers.expat import ExpatError

from rosgraph.network import ROSHandshakeException, read_ros_handshake_header, write_ros_handshake_header

from hero_node import TooLongError, find_messages
from hero_node.ros import MASTER_TIMEOUT_S, SUCCESS, LimitedTransport

READ_LENGTH = 65536
READS_MAX = 200
"""Reads of one publisher at a time, so that none keeps others waiting."""

MESSAGE_LENGTH_MAX = 1 << 28
"""A publisher that announces more does not speak TCPROS."""


class Source(NamedTuple):
    """A publisher of a topic."""

    topic: str
    node: str


class Stream:
    """One connection.

    Attributes:
        header: what the publisher says of itself: md5sum, callerid, latching.
    """

    def __init__(self, sock: socket.socket, header: Dict[str, str], begun: bytes = b"") -> None:
        """begun: what was read behind the header."""
        self.header = header
        self.is_open = True
        self._socket = sock
        self._data = bytearray(begun)
        sock.setblocking(False)

    def fileno(self) -> int:
        """Return the socket's file descriptor, the same one until close()."""
        return self._socket.fileno()

    def read(self) -> List[bytes]:
        """Return the messages that are complete; returns at once. At the publisher's end is_open becomes False."""
        try:
            for _ in range(READS_MAX):
                chunk = self._socket.recv(READ_LENGTH)
                self._data += chunk
                self.is_open = bool(chunk)
                if len(chunk) < READ_LENGTH:
                    break
        except OSError as error:
            self.is_open = error.errno in (errno.EAGAIN, errno.EINTR)
        return self._split()

    def _split(self) -> List[bytes]:
        data, end, messages = self._data, 0, []
        try:
            for start, end in find_messages(data, MESSAGE_LENGTH_MAX):
                messages.append(bytes(data[start:end]))
        except TooLongError:
            self.is_open = False
        del data[:end]
        return messages

    def close(self) -> None:
        """Disconnect; may be called twice."""
        self.is_open = False
        self._socket.close()


def open_stream(topic: str, node_uri: str, own_name: str) -> Stream:
    """Connect to a node that publishes a topic; blocks, for seconds if the node hangs. Raises: OSError."""
    buffer = BytesIO()
    with contextlib.ExitStack() as opened:
        try:
            with xmlrpc.client.ServerProxy(node_uri, transport=LimitedTransport()) as node:
                answer: Any = node.requestTopic(own_name, topic, [["TCPROS"]])
            code, text, protocol = answer
            if code != SUCCESS or not protocol:
                raise OSError(f"{topic}: {text}")
            _, host, port = protocol
            sock = opened.enter_context(socket.create_connection((host, port), MASTER_TIMEOUT_S))
            wish = {"topic": topic, "callerid": own_name, "type": "*", "md5sum": "*", "tcp_nodelay": "0"}
            write_ros_handshake_header(sock, wish)
            header = read_ros_handshake_header(sock, buffer, READ_LENGTH)
        except (HTTPException, xmlrpc.client.Error, ExpatError, ROSHandshakeException, ValueError, TypeError) as error:
            raise OSError(f"{urlsplit(node_uri).netloc}: {error}") from None
        if "error" in header:
            raise OSError(header["error"])
        opened.pop_all()  # the stream keeps the socket open
    return Stream(sock, header, buffer.getvalue())


class StreamSet:
    """Streams by their sources."""

    def __init__(self) -> None:
        self._keys: Dict[Source, selectors.SelectorKey] = {}
        self._selector = selectors.DefaultSelector()
        self._unread: List[Source] = []  # whose first message may have come with the header

    def __contains__(self, source: Source) -> bool:
        return source in self._keys

    def __iter__(self) -> Any:
        return iter(list(self._keys))

    def add(self, source: Source, stream: Stream) -> None:
        """Read a stream from now on."""
        self._keys[source] = self._selector.register(stream, selectors.EVENT_READ, source)
        self._unread.append(source)

    def drop(self, source: Source) -> None:
        """Close a stream."""
        stream: Any = self._keys.pop(source).fileobj
        self._selector.unregister(stream)
        stream.close()

    def read(self) -> List[Any]:
        """Return (source, header, messages) of all that have some, and drop those that have ended; returns at once."""
        found = []
        ready = [key.data for key, _ in self._selector.select(0)]
        ready += [source for source in self._unread if source in self and source not in ready]
        self._unread = []
        for source in ready:
            stream: Any = self._keys[source].fileobj
            messages = stream.read()
            if messages:
                found.append((source, stream.header, messages))
            if not stream.is_open:
                self.drop(source)
        return found
