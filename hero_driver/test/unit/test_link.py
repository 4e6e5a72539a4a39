"""What a link does to a TCP connection."""

import socket

import pytest

from hero_driver.transport import Address, Link


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
