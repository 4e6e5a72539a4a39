"""Messages to subscribers over real sockets: whole ones, the newest kept, a slow subscriber delays nobody."""

import fcntl
import socket
import struct
import termios
import threading
import time
from types import SimpleNamespace
from unittest.mock import create_autospec

import pytest
import rospy
import rospy.topics
from rospy.impl.tcpros_base import TCPROSTransport, TCPROSTransportProtocol

from hero_driver.ros.raw_publisher import (
    RETRY_S,
    TRANSFORMS_MAX,
    TRANSFORMS_PERIOD_S,
    RawPublisher,
    TransformPublisher,
)

QUEUE_LENGTH = 10
LARGE = 20000
"""Bytes of a message of which a subscriber's socket holds only a few."""

DEADLINE_S = 60.0


class Publisher:
    """What rospy.Publisher is to a raw publisher, without a ROS master."""

    def __init__(self, name, raw_class, queue_size, tcp_nodelay):
        self.impl = SimpleNamespace(
            connections=[],
            set_queue_size=lambda length: None,
            c_lock=threading.Lock(),
            connection_poll=rospy.topics.Poller(),
        )
        self.unregistered = False

    def unregister(self):
        self.unregistered = True
        self.impl = None


class Subscriber:
    """A subscriber's end of a connection, whose other end is rospy's own."""

    def __init__(self, publisher):
        with socket.create_server(("127.0.0.1", 0)) as server:
            self.socket = socket.socket()
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, LARGE)
            self.socket.connect(server.getsockname())
            ours, _ = server.accept()
        ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, LARGE)
        self.connection = TCPROSTransport(TCPROSTransportProtocol("/topic", None), "/topic")
        self.connection.socket = ours
        self.connection.set_cleanup_callback(self.leave)
        self._publisher = publisher
        publisher.impl.connections = [*publisher.impl.connections, self.connection]

    def leave(self, connection=None):
        if self._publisher.impl is not None:
            connections = self._publisher.impl.connections
            self._publisher.impl.connections = [other for other in connections if other is not self.connection]

    def read(self):
        """Return all that was sent so far."""
        data = b""
        deadline_s = time.monotonic() + DEADLINE_S
        while time.monotonic() < deadline_s:
            unacknowledged = fcntl.ioctl(self.connection.socket, termios.TIOCOUTQ, bytes(4))
            try:
                data += self.socket.recv(1 << 20, socket.MSG_DONTWAIT)
            except BlockingIOError:
                if unacknowledged == bytes(4):
                    return data
        raise AssertionError("what was sent did not arrive within %.0f s" % DEADLINE_S)


def split(data):
    """Return the messages in data; the last one may not be whole."""
    messages = []
    while data:
        length = struct.unpack_from("<I", data)[0]
        messages.append(data[4 : 4 + length])
        data = data[4 + length :]
    return messages


class Bench:
    """A raw publisher, its rospy publisher, and the loop's timer."""

    def __init__(self, monkeypatch):
        monkeypatch.setattr(rospy, "Publisher", Publisher)
        self.timers = []
        self.publisher = RawPublisher(QUEUE_LENGTH, lambda delay_s, call: self.timers.append((delay_s, call)))
        self.publisher.open("/topic", object)
        self.rospy_publisher = self.publisher._publisher

    def subscribe(self):
        return Subscriber(self.rospy_publisher)

    def run_timers(self):
        timers, self.timers = self.timers, []
        for delay_s, call in timers:
            assert delay_s == RETRY_S
            call()

    def drain(self, subscriber):
        """Read and retry until nothing more comes; return everything."""
        data = subscriber.read()
        while self.timers:
            self.run_timers()
            data += subscriber.read()
        return data


@pytest.fixture
def bench(monkeypatch):
    return Bench(monkeypatch)


def make_message(number, length=LARGE):
    return struct.pack("<I", number) * (length // 4)


def read_numbers(messages):
    """Return the numbers of messages, and check that each is whole."""
    numbers = [struct.unpack_from("<I", message)[0] for message in messages]
    assert messages == [make_message(number) for number in numbers]
    return numbers


def test_every_subscriber_gets_every_message_with_its_length_in_front(bench):
    subscribers = [bench.subscribe() for _ in range(3)]
    for payload in (b"one", b"", b"\x00" * 700):
        bench.publisher.publish(payload)
    for subscriber in subscribers:
        assert subscriber.read() == b"\x03\x00\x00\x00one" + bytes(4) + b"\xbc\x02\x00\x00" + bytes(700)
        assert subscriber.connection.stat_num_msg == 3
    assert bench.timers == []


def test_a_publisher_is_wanted_while_it_has_subscribers(bench):
    assert bench.publisher.is_open
    assert not bench.publisher.is_wanted
    bench.publisher.publish(b"to nobody")
    subscriber = bench.subscribe()
    assert bench.publisher.is_wanted
    assert subscriber.read() == b""
    subscriber.leave()
    assert not bench.publisher.is_wanted


def test_a_publisher_that_is_not_open_yet_drops_messages():
    publisher = RawPublisher(QUEUE_LENGTH, lambda delay_s, call: None)
    publisher.publish(b"early")
    assert not publisher.is_open
    assert not publisher.is_wanted
    assert publisher.release() == []


def test_a_slow_subscriber_gets_whole_messages_and_loses_the_oldest(bench):
    subscriber = bench.subscribe()
    for number in range(100):
        bench.publisher.publish(make_message(number))
    numbers = read_numbers(split(bench.drain(subscriber)))
    assert numbers == sorted(set(numbers))
    assert numbers[-QUEUE_LENGTH:] == list(range(100 - QUEUE_LENGTH, 100))
    assert len(numbers) + bench.publisher.dropped == 100
    assert bench.publisher.dropped > 0


def test_a_subscriber_that_caught_up_gets_messages_at_once_again(bench):
    subscriber = bench.subscribe()
    for number in range(8):
        bench.publisher.publish(make_message(number))
    assert bench.timers
    assert read_numbers(split(bench.drain(subscriber))) == list(range(8))
    assert bench.publisher.dropped == 0
    bench.publisher.publish(b"next")
    assert subscriber.read() == b"\x04\x00\x00\x00next"
    assert bench.timers == []


def test_there_is_one_timer_however_many_subscribers_are_slow(bench):
    for _ in range(3):
        bench.subscribe()
    for number in range(20):
        bench.publisher.publish(make_message(number))
    assert len(bench.timers) == 1
    bench.run_timers()
    assert len(bench.timers) == 1


def test_a_slow_subscriber_does_not_delay_the_others(bench):
    slow, quick = bench.subscribe(), bench.subscribe()
    for number in range(50):
        bench.publisher.publish(make_message(number))
        assert split(quick.read()) == [make_message(number)]
    assert read_numbers(split(bench.drain(slow)))[-1] == 49


def test_messages_published_while_a_subscriber_catches_up_keep_their_order(bench):
    subscriber = bench.subscribe()
    data = b""
    for number in range(60):
        bench.publisher.publish(make_message(number))
        if number % 3 == 0:
            data += subscriber.socket.recv(LARGE // 2)
            bench.run_timers()
    data += bench.drain(subscriber)
    numbers = read_numbers(split(data))
    assert numbers == sorted(set(numbers))
    assert numbers[-1] == 59
    assert len(numbers) + bench.publisher.dropped == 60


def test_a_subscriber_that_is_gone_is_closed_and_the_others_go_on(bench):
    gone, here = bench.subscribe(), bench.subscribe()
    gone.socket.close()
    bench.publisher.publish(b"one")
    deadline_s = time.monotonic() + DEADLINE_S
    while not gone.connection.done and time.monotonic() < deadline_s:
        bench.publisher.publish(b"two")
    assert bench.rospy_publisher.impl.connections == [here.connection]
    assert split(here.read())[:2] == [b"one", b"two"]


def test_what_waits_for_a_subscriber_that_left_is_forgotten(bench):
    subscriber = bench.subscribe()
    for number in range(20):
        bench.publisher.publish(make_message(number))
    subscriber.leave()
    bench.run_timers()
    assert bench.timers == []
    assert not bench.publisher._backlogs


def test_a_slow_subscriber_that_left_holds_up_no_other_slow_one(bench):
    first, second = bench.subscribe(), bench.subscribe()
    for number in range(QUEUE_LENGTH):
        bench.publisher.publish(make_message(number))
    first.leave()
    received = second.read()
    bench.run_timers()
    assert len(received + second.read()) > len(received)
    assert len(bench.timers) == 1


def test_a_subscriber_that_breaks_while_it_is_slow_is_forgotten(bench):
    subscriber = bench.subscribe()
    for number in range(20):
        bench.publisher.publish(make_message(number))
    subscriber.socket.close()
    deadline_s = time.monotonic() + DEADLINE_S
    while bench.timers and time.monotonic() < deadline_s:
        bench.run_timers()
    assert not bench.publisher._backlogs
    assert bench.rospy_publisher.impl.connections == []


def test_a_connection_without_a_socket_takes_nothing_and_does_no_harm(bench):
    subscriber = bench.subscribe()
    subscriber.connection.socket = None
    bench.publisher.publish(b"one")
    assert bench.timers == []


def test_a_released_publisher_publishes_nothing_and_unregisters(bench):
    subscriber = bench.subscribe()
    for number in range(20):
        bench.publisher.publish(make_message(number))
    before = len(subscriber.read())
    (unregister,) = bench.publisher.release()
    poller = bench.rospy_publisher.impl.connection_poll.poller
    assert not bench.publisher.is_open
    bench.publisher.publish(b"late")
    while bench.timers:
        bench.run_timers()
    assert (len(subscriber.read()), before > 0) == (0, True)
    assert not bench.rospy_publisher.unregistered
    unregister()
    assert bench.rospy_publisher.unregistered
    assert poller.closed, "its file must not wait for Python's garbage collection"
    assert bench.publisher.release() == []


@pytest.mark.parametrize("is_wanted", [True, False])
def test_transforms_of_a_moment_are_one_message_or_parts_of_it(monkeypatch, is_wanted):
    later, sent = [], []
    transforms = TransformPublisher(lambda delay_s, call: later.append((delay_s, call)))
    transforms._publisher = create_autospec(RawPublisher, instance=True, is_wanted=is_wanted)
    transforms._publisher.publish.side_effect = sent.append
    transforms.schedule()
    assert later == [] and not transforms.is_scheduled, "there are none"
    for count in (2, TRANSFORMS_MAX + 1):
        for number in range(count):
            transforms.add(struct.pack("<H", number))
        transforms.schedule()
        assert transforms.is_scheduled
        ((delay_s, publish),) = later
        later.clear()
        publish()
        assert delay_s == TRANSFORMS_PERIOD_S and not transforms.is_scheduled
    numbers = [struct.unpack("<I%dH" % ((len(message) - 4) // 2), message) for message in sent]
    assert [(first, len(rest)) for first, *rest in numbers] == (
        [(2, 2), (TRANSFORMS_MAX, TRANSFORMS_MAX), (1, 1)] if is_wanted else []
    )
    transforms.schedule()
    assert later == [], "each goes out once, or not at all"
