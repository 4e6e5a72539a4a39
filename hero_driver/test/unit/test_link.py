"""What a link does to a TCP connection."""

import socket

import pytest

from hero_driver.transport.link import UNSENT_MAX, Address, Link


def read_quick_acknowledge(sock):
    return sock.getsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK)


@pytest.fixture
def pair():
    """Return both ends of a TCP connection; the first one has answered, so that its kernel delays acknowledgements."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        far = socket.create_connection(server.getsockname())
        near, _ = server.accept()
    for _ in range(3):
        far.sendall(b"question")
        near.recv(100)
        near.sendall(b"answer")
        far.recv(100)
    yield near, far
    near.close()
    far.close()


def test_what_a_robot_sends_is_acknowledged_at_once(pair):
    near, far = pair
    near.setsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK, 0)
    assert read_quick_acknowledge(near) == 0
    link = Link(None, near, Address("127.0.0.1", 1))
    far.sendall(b"a burst")
    assert link.read() == b"a burst"
    assert read_quick_acknowledge(near) == 1
    near.setblocking(False)
    assert link.read() == b"" and not link.closed and link.received_length == 7


class Owner:
    """Takes what a link asks of its loop."""

    def __init__(self):
        self.calls = []

    def watch(self, link):
        """Have nothing to do."""

    def call_soon(self, call):
        self.calls.append(call)

    def close_link(self, link, reason):
        self.reason = reason


class NarrowSocket:
    """Takes a few bytes of each write, or none."""

    def __init__(self, *lengths):
        self.lengths = list(lengths)
        self.taken = b""

    def setsockopt(self, *_):
        """Have nothing to do."""

    def send(self, data):
        length = self.lengths.pop(0) if self.lengths else 0
        if length == 0:
            raise BlockingIOError
        self.taken += data[:length]
        return min(length, len(data))


def test_what_is_unsent_is_counted_by_what_the_socket_took():
    sock = NarrowSocket(10, 0, 20, 30)
    link = Link(Owner(), sock, Address("127.0.0.1", 1))
    packet = bytes(range(200))
    link.send_packet(packet)
    assert (link._unsent_length, link.handed_length) == (190, 200)
    for left in (190, 170, 140, 140):
        link.flush()
        assert link._unsent_length == left
    sock.lengths = [1000]
    link.flush()
    assert link._unsent_length == 0
    assert sock.taken == packet


def test_a_peer_that_reads_little_by_little_is_closed_at_unsent_max():
    sock, owner = NarrowSocket(), Owner()
    link = Link(owner, sock, Address("127.0.0.1", 1))
    packet = bytes(1000)
    for _ in range(UNSENT_MAX // len(packet)):
        link.send_packet(packet)
        sock.lengths = [10, 0]
        link.flush()
    assert owner.calls == []
    for _ in range(3):
        link.send_packet(packet)
    assert owner.calls
    assert len(sock.taken) == 10 * (UNSENT_MAX // len(packet))


def test_a_link_that_is_discarded_frees_its_socket_and_what_waits(pair):
    near, far = pair
    link = Link(Owner(), near, Address("127.0.0.1", 1))
    far.sendall(b"seven b")
    assert link.read() == b"seven b"
    far.sendall(b"more")
    assert link.read() == b"more"
    assert link.received_length == 11
    link._unsent.append(b"rest")
    for _ in range(2):
        link.discard()
        assert link.closed and not link.is_full
        assert near.fileno() == -1
    assert far.recv(1) == b"", "the robot does not see the end"


def test_what_waits_is_unacknowledged_until_the_end(pair):
    _, far = pair
    link = Link(Owner(), far, Address("127.0.0.1", 1))
    assert link.read_unacknowledged_length() == 0, "answers have acknowledged it"
    for kept, length in ((b"12345", 5), (b"1234567", 12)):
        link._keep(kept)
        assert link.read_unacknowledged_length() == length
    link.discard()
    assert link.read_unacknowledged_length() == 0
    link.send_packet(b"late")
    assert link.handed_length == 0 and not link.is_full


@pytest.mark.parametrize("packets", [[65536], [65535, 1], [1, 65535]])
def test_64_kib_may_wait_for_a_peer_and_not_a_byte_more(packets):
    owner = Owner()
    link = Link(owner, NarrowSocket(), Address("127.0.0.1", 1))
    for length in packets:
        link.send_packet(bytes(length))
    assert owner.calls == [] and link.is_full
    link.send_packet(b"1")
    (close,) = owner.calls
    close()
    assert owner.reason == "it does not read: 65536 bytes wait for it"
    assert link._unsent_length == 65536


def test_a_socket_that_breaks_when_it_is_written_is_closed_with_the_reason():
    owner, sock = Owner(), NarrowSocket()
    sock.send = lambda data: (_ for _ in ()).throw(BrokenPipeError(32, "Broken pipe"))
    link = Link(owner, sock, Address("127.0.0.1", 1))
    link.send_packet(b"packet")
    (close,) = owner.calls
    close()
    assert owner.reason == "write failed: Broken pipe" and not link.is_full
