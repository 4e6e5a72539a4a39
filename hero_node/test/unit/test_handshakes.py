"""Connection headers over real sockets: nobody waits for one that is late, and what is late is closed."""

import queue
import socket
import struct
import threading
from unittest import mock

import pytest

from hero_node.ros import handshakes
from hero_node.ros.handshakes import (
    HANDSHAKE,
    HEADER_LENGTH_MAX,
    LAST_HANDSHAKE,
    THREAD_TRIES,
    ConnectionLimit,
    HandshakeReader,
)

DEADLINE_S = 60.0
HEADER = struct.pack("<I", 9) + b"some text"


class Server:
    """A reader behind a real listening socket; what it serves comes out of a queue."""

    def __init__(self):
        self.served = queue.Queue()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._clients = []
        self.reader = None

    def open(self, **settings):
        self.reader = HandshakeReader(lambda *served: self.served.put(served), **settings)

    def connect(self, data=b"", host="127.0.0.1"):
        """Return a client that has sent data and is in the reader's hands."""
        client = socket.create_connection(self._listener.getsockname(), DEADLINE_S, (host, 0))
        self._clients.append(client)
        self.reader.add(*self._listener.accept())
        client.sendall(data)
        return client

    def take(self):
        """Return (socket, address, header) of the next connection that is served."""
        served = self.served.get(timeout=DEADLINE_S)
        self._clients.append(served[0])
        return served

    def close(self):
        for sock in (self._listener, *self._clients):
            sock.close()


def is_closed(client):
    """Wait until a client gets something; return whether that is the end."""
    try:
        return client.recv(1) == b""
    except ConnectionResetError:
        return True


@pytest.fixture(name="server")
def make_server():
    server = Server()
    yield server
    server.close()


def test_a_whole_header_is_served_and_what_follows_is_left_on_the_socket(server):
    server.open()
    client = server.connect(HEADER + b"a request")
    sock, address, header = server.take()
    assert (address, header) == (client.getsockname(), HEADER)
    assert sock.gettimeout() is None
    assert sock.recv(100) == b"a request"


@pytest.mark.parametrize("length", [1, 3, 4, 5, len(HEADER) - 1])
def test_a_header_in_two_pieces_is_served_once_it_is_whole(server, length):
    server.open()
    client = server.connect(HEADER[:length])
    server.connect(HEADER)
    server.take()
    assert server.served.empty(), "half a header was served"
    client.sendall(HEADER[length:])
    assert server.take()[2] == HEADER


@pytest.mark.parametrize("length", [3, 5, len(HEADER) - 1])
def test_a_header_that_ends_before_its_length_is_not_served(server, length):
    server.open()
    client = server.connect(HEADER[:length])
    client.shutdown(socket.SHUT_WR)
    assert is_closed(client) and server.served.empty()


def test_a_hundred_waiting_in_the_middle_delay_no_other(server):
    server.open()
    for _ in range(100):
        server.connect(b"\x10\x00")
    client = server.connect(HEADER)
    assert server.take()[1] == client.getsockname()


def test_a_connection_that_is_served_slowly_delays_no_other(server):
    first_is_served, released = threading.Event(), threading.Event()

    def serve(sock, address, header):
        if address == first.getsockname():
            first_is_served.set()
            released.wait(DEADLINE_S)
        server.served.put((sock, address, header))

    server.reader = HandshakeReader(serve)
    first = server.connect()
    first.sendall(HEADER)
    assert first_is_served.wait(DEADLINE_S)
    second = server.connect(HEADER)
    address = server.take()[1]
    released.set()
    assert address == second.getsockname()


@pytest.mark.parametrize("sent", [b"", b"\x10\x00", HEADER[:-1]])
def test_a_header_that_does_not_come_in_time_ends_the_connection(server, sent):
    server.open(timeout_s=0.1)
    client = server.connect(sent)
    assert is_closed(client)


@pytest.mark.parametrize("length", [0, HEADER_LENGTH_MAX + 1, 0xFFFFFFFF])
def test_a_length_that_no_header_has_ends_the_connection_at_once(server, length):
    server.open(timeout_s=10 * DEADLINE_S)
    client = server.connect(struct.pack("<I", length))
    assert is_closed(client)
    assert server.served.empty()


def test_the_longest_header_is_served(server):
    server.open()
    longest = struct.pack("<I", HEADER_LENGTH_MAX) + bytes(HEADER_LENGTH_MAX)
    server.connect(longest)
    assert server.take()[2] == longest


def test_one_too_many_closes_the_oldest_of_the_address_with_the_most(server):
    server.open(timeout_s=10 * DEADLINE_S, pending_max=4)
    other = server.connect(host="127.0.0.2")
    many = [server.connect() for _ in range(3)]
    newest = server.connect(host="127.0.0.3")
    assert is_closed(many[0])
    for client in (other, many[1], many[2], newest):
        client.sendall(HEADER)
    addresses = {server.take()[1] for _ in range(4)}
    assert addresses == {client.getsockname() for client in (other, many[1], many[2], newest)}


def test_a_connection_that_ends_without_a_header_is_closed_and_forgotten():
    sock = mock.create_autospec(socket.socket, instance=True)
    sock.recv.return_value = b""
    reader = HandshakeReader(mock.Mock(side_effect=AssertionError("served")))
    reader._pending.add(sock, ("10.0.0.1", 5))
    reader._run(sock, ("10.0.0.1", 5))
    sock.close.assert_called_once_with()
    assert not reader._pending.remove(sock)


def test_one_that_is_closed_already_makes_room_for_the_next():
    limit, socks = ConnectionLimit(2), [socket.socket() for _ in range(3)]
    for sock in socks:  # none is connected, so that none can be shut down
        limit.add(sock, ("127.0.0.1", 1))
        sock.close()
    assert [limit.remove(sock) for sock in socks] == [False, True, True]
    assert [limit.remove(sock) for sock in socks] == [False] * 3


@pytest.mark.parametrize("lacking", [3, THREAD_TRIES + 1])
def test_a_program_without_a_thread_is_kept_for_2_s_then_refused(lacking, monkeypatch):
    served, names, slept_s = queue.Queue(), [], []
    start = threading.Thread.start

    def lack(thread):
        names.append(thread.name)
        if len(names) <= lacking:
            raise RuntimeError("can't start new thread")
        start(thread)

    monkeypatch.setattr(threading.Thread, "start", lack)
    monkeypatch.setattr(handshakes.time, "sleep", slept_s.append)
    ours, theirs = socket.socketpair()
    theirs.settimeout(DEADLINE_S)
    theirs.sendall(HEADER)
    HandshakeReader(lambda *connection: served.put(connection)).add(ours, ("127.0.0.1", 1))
    if lacking == 3:
        assert served.get(timeout=DEADLINE_S)[0] is ours and names == [HANDSHAKE] * 4
    else:
        assert is_closed(theirs) and names[-1] == LAST_HANDSHAKE
        assert 1.9 < sum(slept_s) < 2.2
    ours.close()
    theirs.close()
