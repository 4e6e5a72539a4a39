"""Serves programs that connect to this node's topics and services, by rospy's internals: none can hold up another.

Sources: rospy 1.15 to 1.17 (impl/tcpros_base.py), and the TCPROS protocol.
"""

import socket
from typing import Any, Callable

import rosgraph.xmlrpc
import rospy
from rosgraph.network import decode_ros_handshake_header, write_ros_handshake_header
from rospy.impl import tcpros_base

from .handshakes import ConnectionLimit, HandshakeReader

XMLRPC_CONNECTIONS_MAX = 256
"""Connections of the master and of other nodes, one of each, and each with a thread for as long as it is open."""

WAITING_CONNECTIONS = 1024
"""Subscribers that may wait to be accepted; rospy's 5 stall in TCP's back-off when RViz comes for fifty robots' topics.
The system may cap it (net.core.somaxconn, 4096 on Linux)."""

REASON_LENGTH_MAX = 300
"""rospy's reason to refuse a connection may list every topic of the node: 200 kB with 100 robots."""


class LimitedXmlRpcServer(rosgraph.xmlrpc.ThreadingXMLRPCServer):
    """Serves the calls to this node."""

    def __init__(self, *arguments: Any) -> None:
        self._limit = ConnectionLimit(XMLRPC_CONNECTIONS_MAX)
        super().__init__(*arguments)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve a connection on its own thread, which the oldest one may lose for it."""
        self._limit.add(request, client_address)
        super().process_request(request, client_address)

    def shutdown_request(self, request: Any) -> None:
        """Close a connection."""
        self._limit.remove(request)
        super().shutdown_request(request)


def limit_xmlrpc_connections() -> None:
    """Keep connections that send no whole call from taking all threads; for the time before rospy.init_node()."""
    rosgraph.xmlrpc.ThreadingXMLRPCServer = LimitedXmlRpcServer  # type: ignore[misc, assignment]


def open_tcpros_server(warn: Callable[[str, str], None]) -> None:
    """Serve programs that connect, none of which can hold up another; call it before rospy.init_node().

    rospy reads one connection header after another, without a time limit: one that sends two bytes and waits would keep
    every other subscriber out. warn(address, text) is called from any thread.
    """
    server = tcpros_base.init_tcpros_server()

    def serve(sock: socket.socket, address: Any, data: bytes) -> None:
        reason = _serve_connection(server, sock, address, data)
        if reason:
            warn(address[0], f"connection of {address[0]} to a topic or service refused: {reason}")

    server._tcp_server_callback = HandshakeReader(serve).add
    tcpros_base.start_tcpros_server()
    # A second listen() on a socket that listens changes how many may wait.
    server.tcp_ros_server.server_sock.listen(WAITING_CONNECTIONS)


def _serve_connection(server: Any, sock: socket.socket, address: Any, data: bytes) -> str:
    """Hand a connection with its header (data) to rospy, as TCPROSServer does; return why not, empty if served."""
    try:
        header = decode_ros_handshake_header(data)
        if "topic" in header:
            refusal = server.topic_connection_handler(sock, address, header)
        elif "service" in header:
            refusal = server.service_connection_handler(sock, address, header)
        else:
            refusal = "topic missing"
        if not refusal:
            return ""
        reason = str(refusal)[:REASON_LENGTH_MAX]
        write_ros_handshake_header(sock, {"error": reason})
    except Exception as error:  # noqa: BLE001 - whatever the header does to rospy, only this connection is lost
        reason = f"{type(error).__name__}: {str(error)[:REASON_LENGTH_MAX]}"
    sock.close()
    return "" if rospy.core.is_shutdown_requested() else ascii(reason)[1:-1]
