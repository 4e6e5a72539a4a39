"""A real loop with real connections: what it reads, and how it ends."""

import os
import socket
import struct
import threading

import pytest

from hero_driver.transport import EventLoop, LinkHandler, TransportSettings

DEADLINE_S = 60.0


class Handler(LinkHandler):
    """Notes what comes when."""

    def __init__(self):
        self.changed = threading.Condition()
        self.reads = []  # pairs: bytes, when they were read
        self.endings = []
        self.loop = self.thread = None

    def open_link(self, link):
        """Take everybody."""

    def receive_data(self, link, data, now_s):
        with self.changed:
            self.reads.append((data, now_s))
            self.changed.notify_all()

    def poll_link(self, link, now_s):
        """Have nothing to do."""

    def resume(self, now_s):
        """Have nothing to do."""

    def close_link(self, link, reason):
        with self.changed:
            self.endings.append(reason)
            self.changed.notify_all()

    def wait(self, condition):
        with self.changed:
            assert self.changed.wait_for(condition, DEADLINE_S)


@pytest.fixture
def start():
    loops = []

    def start_loop(host="127.0.0.1"):
        handler = Handler()
        handler.loop = EventLoop(TransportSettings(host, 0, (), 1.0))
        handler.loop.open(handler)
        thread = threading.Thread(target=handler.loop.run, daemon=True)
        thread.start()
        handler.thread = thread
        loops.append((handler.loop, thread))
        return handler, socket.create_connection(handler.loop.listening)

    yield start_loop
    for loop, thread in loops:
        loop.stop()
        thread.join(DEADLINE_S)


def test_a_connection_that_breaks_is_closed_at_once_with_the_reason(start):
    handler, far = start()
    far.sendall(b"first")
    handler.wait(lambda: len(handler.reads) == 1)
    far.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    far.close()
    handler.wait(lambda: handler.endings)
    assert handler.endings == ["read failed: Connection reset by peer"]


def has_ipv6():
    """Whether this PC has addresses of IPv6; containers often have none."""
    try:
        with socket.socket(socket.AF_INET6) as sock:
            sock.bind(("::1", 0))
    except OSError:
        return False
    return True


@pytest.mark.skipif(not has_ipv6(), reason="this PC has no IPv6")
def test_robots_are_heard_on_all_addresses_of_ipv6_and_ipv4(start):
    handler, far = start("::")
    assert str(handler.loop.listening) == "[::]:%d" % handler.loop.listening.port
    with far, socket.create_connection(("127.0.0.1", handler.loop.listening.port)) as near:
        far.sendall(b"six")
        near.sendall(b"four")
        handler.wait(lambda: {data for data, _ in handler.reads} == {b"six", b"four"})


def test_the_end_of_the_loop_closes_every_file_that_it_opened(start):
    before = set(os.listdir("/proc/self/fd"))
    handler, far = start()
    with far:
        far.sendall(b"first")
        handler.wait(lambda: handler.reads)
        handler.loop.stop()
        handler.wait(lambda: handler.endings)
        handler.thread.join(DEADLINE_S)
    assert set(os.listdir("/proc/self/fd")) == before


def test_a_call_after_the_end_of_the_loop_does_no_harm(start):
    handler, far = start()
    far.close()
    handler.loop.stop()
    handler.thread.join(DEADLINE_S)
    calls = []
    handler.loop.call_soon(lambda: calls.append("late"))
    assert calls == []


def test_connections_notice_a_peer_that_vanished_and_delay_nothing():
    with socket.socket() as near:
        for timeout_s, idle_s in ((8.0, 4), (1.0, 1)):
            EventLoop(TransportSettings("", 0, (), timeout_s))._set_options(near)
            tcp = {
                socket.TCP_NODELAY: 1,
                socket.TCP_KEEPIDLE: idle_s,
                socket.TCP_KEEPINTVL: 1,
                socket.TCP_KEEPCNT: 3,
                socket.TCP_USER_TIMEOUT: int(1000 * timeout_s),
            }
            assert {option: near.getsockopt(socket.IPPROTO_TCP, option) for option in tcp} == tcp
            assert near.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE) == 1 and not near.getblocking()
