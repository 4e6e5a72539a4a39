"""Which files are ready, with the system's epoll and without one."""

import select
import socket

import pytest

from hero_driver.transport.poller import READ, WRITE, Poller


@pytest.fixture(params=["epoll", "poll"])
def poller(request, monkeypatch):
    if request.param == "poll":
        monkeypatch.delattr(select, "epoll")
    poller = Poller()
    yield poller
    poller.close()


@pytest.fixture
def pair():
    near, far = socket.socketpair()
    near.setblocking(False)
    yield near, far
    near.close()
    far.close()


def ignore(mask):
    """Serve nothing."""


def test_nothing_is_ready_when_the_time_is_over(poller, pair):
    poller.register(pair[0].fileno(), READ, ignore)
    assert poller.wait(0.0) == []
    assert poller.wait(0.001) == []


def test_what_can_be_read_is_ready_until_it_was_read(poller, pair):
    near, far = pair
    poller.register(near.fileno(), READ, ignore)
    far.send(b"bytes")
    for _ in range(2):
        assert poller.wait(None) == [(near.fileno(), READ)]
    near.recv(100)
    assert poller.wait(0.0) == []


def test_what_can_be_written_is_ready_where_that_is_waited_for(poller, pair):
    near, far = pair
    poller.register(near.fileno(), WRITE, ignore)
    assert poller.wait(None) == [(near.fileno(), WRITE)]
    far.send(b"bytes")
    poller.modify(near.fileno(), READ | WRITE)
    assert poller.wait(None) == [(near.fileno(), READ | WRITE)]
    poller.modify(near.fileno(), READ)
    assert poller.wait(None) == [(near.fileno(), READ)]


def test_the_end_of_a_connection_is_ready_to_be_read(poller, pair):
    near, far = pair
    poller.register(near.fileno(), READ, ignore)
    far.close()
    ((descriptor, mask),) = poller.wait(None)
    assert descriptor == near.fileno()
    assert mask != WRITE
    assert near.recv(100) == b""


def test_what_is_waited_for_no_more_is_not_ready_and_is_not_served(poller, pair):
    near, far = pair
    poller.register(near.fileno(), READ, ignore)
    assert poller.serves == {near.fileno(): ignore}
    far.send(b"bytes")
    poller.unregister(near.fileno())
    assert poller.serves == {}
    assert poller.wait(0.0) == []
