"""Programs that connect are served one beside the other, and a refusal is one line."""

import queue
import socket
import struct
import threading
import xmlrpc.client
from pathlib import Path

import pytest
from rosgraph.network import decode_ros_handshake_header, encode_ros_handshake_header
from rospy.impl import tcpros_base

from hero_node.ros import connections
from hero_node.ros.connections import REASON_LENGTH_MAX, open_tcpros_server
from hero_node.ros.handshakes import HandshakeReader

DEADLINE_S = 60.0


class TcprosServer:
    """rospy's own server with our changes."""

    def __init__(self):
        self.warnings = queue.Queue()
        self.headers = []
        open_tcpros_server(lambda host, text: self.warnings.put((host, text)))
        self._server = tcpros_base._tcpros_server
        self._server.topic_connection_handler = self._serve
        self._clients = []

    def _serve(self, sock, _address, header):
        self.headers.append(header)
        if header["topic"] == "/broken":
            raise ValueError("a bug of rospy's\n")
        if header["topic"] != "/odom":
            return "no such topic: %s; there are %s" % (header["topic"], "/topic " * 10000)
        sock.sendall(b"served")
        return None

    def connect(self, data=b""):
        client = socket.create_connection(("127.0.0.1", self._server.get_address()[1]), DEADLINE_S)
        self._clients.append(client)
        client.sendall(data)
        return client

    def close(self):
        self._server.shutdown()
        for client in self._clients:
            client.close()


@pytest.fixture(name="server")
def make_server(monkeypatch):
    monkeypatch.setattr(tcpros_base, "_tcpros_server", tcpros_base.TCPROSServer())
    server = TcprosServer()
    yield server
    server.close()


def read_refusal(client):
    """Return the reason in the header that refuses a connection, which is closed after it."""
    data = b""
    while True:
        piece = client.recv(65536)
        if not piece:
            return decode_ros_handshake_header(data)["error"]
        data += piece


def test_a_subscriber_is_served_while_a_hundred_others_have_sent_two_bytes(server):
    for _ in range(100):
        server.connect(b"\x10\x00")
    client = server.connect(encode_ros_handshake_header({"topic": "/odom"}))
    assert client.recv(6, socket.MSG_WAITALL) == b"served"
    assert server.warnings.empty()


def test_a_refused_subscriber_learns_why_in_few_words(server):
    client = server.connect(encode_ros_handshake_header({"topic": "/other"}))
    reason = read_refusal(client)
    assert reason.startswith("no such topic: /other")
    assert len(reason) <= REASON_LENGTH_MAX


def test_a_connection_that_rospy_cannot_serve_is_closed_with_one_line(server):
    client = server.connect(encode_ros_handshake_header({"topic": "/broken"}))
    assert client.recv(1) == b"", "closed"
    host, text = server.warnings.get(timeout=DEADLINE_S)
    assert host == "127.0.0.1"
    assert "ValueError: a bug of rospy's\\n" in text


def test_bytes_that_are_no_header_close_the_connection(server):
    client = server.connect(struct.pack("<I", 8) + b"\xff" * 8)
    assert client.recv(1) == b"", "closed"
    assert server.headers == []


def test_half_open_calls_take_no_more_threads_than_allowed(monkeypatch):
    monkeypatch.setattr(connections, "XMLRPC_CONNECTIONS_MAX", 3)
    server = connections.LimitedXmlRpcServer(("127.0.0.1", 0), 0)
    server.register_function(lambda: "pong", "ping")
    serving = threading.Thread(target=server.serve_forever, daemon=True)
    serving.start()
    clients = []
    for _ in range(8):
        clients.append(socket.create_connection(server.server_address, DEADLINE_S))
        clients[-1].sendall(b"POST /RPC2 HTTP/1.1\r\n")
    assert [client.recv(1) for client in clients[:5]] == [b""] * 5  # the oldest were closed
    with xmlrpc.client.ServerProxy("http://127.0.0.1:%d" % server.server_address[1]) as node:
        assert node.ping() == "pong"
    for client in clients:
        client.close()
    server.shutdown()
    serving.join()
    server.server_close()


def test_limits_are_those_of_the_document():
    document = (Path(__file__).resolve().parents[3] / "docs" / "security.md").read_text()
    reader = HandshakeReader(lambda *arguments: None)
    assert "closed after %g s; at most %d wait" % (reader._timeout_s, reader._pending._most) in document
    assert "at most %d per node" % connections.XMLRPC_CONNECTIONS_MAX in document


def test_a_call_that_has_ended_is_closed():
    server = connections.LimitedXmlRpcServer(("127.0.0.1", 0))
    try:
        with socket.create_connection(server.server_address[:2], DEADLINE_S) as client:
            request, address = server.get_request()
            server._limit.add(request, address)
            server.shutdown_request(request)
            assert client.recv(1) == b"" and not server._limit.remove(request)
    finally:
        server.server_close()


def test_a_thousand_programs_may_connect_at_once(server):
    details = server._server.tcp_ros_server.server_sock.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 32)
    (may_wait,) = struct.unpack_from("I", details, 28)  # tcpi_sacked, which tells that of a socket that listens
    limit = int(Path("/proc/sys/net/core/somaxconn").read_text())
    assert may_wait == min(1024, limit)
