"""Connections to publishers of topics, without rospy.

rospy reads each publisher on a thread of its own, and waking it costs several times what a message costs; and its
subscriptions to a topic share one class, so that bytes for Foxglove could take the place of a driver's report.
Source: ROS TCPROS and Slave API.
"""

import contextlib
import socket
import xmlrpc.client
from http.client import HTTPException
from io import BytesIO
from typing import Any, Dict, List
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


class Stream:
    """One connection to a publisher.

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

    def read(self) -> List[bytes]:
        """Return the messages that are complete; returns at once. At the publisher's end is_open becomes False."""
        data, end, messages = self._data, 0, []
        try:
            for _ in range(READS_MAX):
                chunk = self._socket.recv(READ_LENGTH)
                data += chunk
                self.is_open = bool(chunk)
                if len(chunk) < READ_LENGTH:
                    break
        except BlockingIOError:
            pass
        except OSError:
            self.is_open = False
        try:
            for start, end in find_messages(data, MESSAGE_LENGTH_MAX):
                messages.append(bytes(data[start:end]))
        except TooLongError:
            self.is_open = False
        del data[:end]
        return messages

    def close(self) -> None:
        """Disconnect; may be called twice."""
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
