"""Messages of publishers over real sockets: rospy's thread hands over after the first, nothing is lost."""

import socket
import struct
import threading
import time
from types import SimpleNamespace

import pytest
import rospy
from rospy.impl.tcpros_base import TCPROSTransport
from rospy.impl.tcpros_pubsub import TCPROSSub
from rospy.topics import _SubscriberImpl
from std_msgs.msg import String

from hero_driver.ros import raw_subscriber, rospy_internals
from hero_driver.ros.message_types import make_raw_class
from hero_driver.ros.raw_subscriber import MESSAGE_LENGTH_MAX, MessageStream, RawSubscriber
from hero_driver.transport.event_loop import EventLoop
from hero_driver.transport.link import LinkHandler

DEADLINE_S = 60.0
RAW_CLASS = make_raw_class(String)


def frame(payload):
    return struct.pack("<I", len(payload)) + payload


class Handler(LinkHandler):
    """Keeps the faults that the loop reports."""

    def __init__(self):
        self.faults = []

    def report_bug(self, error):
        self.faults.append(error)

    def poll(self, now_s):
        """Have nothing to do."""

    def resume(self, now_s):
        """Have nothing to do."""


class Bench:
    """A raw subscriber, a real loop on its own thread, and publishers behind rospy's own connections."""

    def __init__(self, monkeypatch):
        self.handler = Handler()
        self.loop = EventLoop("127.0.0.1", 0, 1.0)
        self.loop.open(self.handler)
        self.loop_thread = threading.Thread(target=self.loop.run, daemon=True)
        self.loop_thread.start()
        self.received = []  # pairs: payload, whether it came on the loop's thread
        self.arrived = threading.Condition()
        self.fails_on = None
        self.impl = _SubscriberImpl("/topic", RAW_CLASS)
        bench = self

        class Subscriber:
            """What rospy.Subscriber is to a raw subscriber, without a ROS master."""

            def __init__(self, name, raw_class, callback, queue_size, tcp_nodelay):
                self.impl = bench.impl
                self.impl.add_callback(callback, None)

            def unregister(self):
                self.impl.close()

        monkeypatch.setattr(rospy, "Subscriber", Subscriber)
        topics = SimpleNamespace(get_subscriber_impl={"/topic": self.impl}.get)
        monkeypatch.setattr(rospy_internals.registration, "get_topic_manager", lambda: topics)
        self.old = []  # payloads that were called old
        self.subscriber = RawSubscriber(self.receive, self.loop)
        self.subscriber.open("/topic", RAW_CLASS, 50)

    def receive(self, payload):
        if payload == self.fails_on:
            raise ValueError("not this one")
        with self.arrived:
            if self.subscriber.is_old:
                self.old.append(payload)
            self.received.append((payload, threading.current_thread() is self.loop_thread))
            self.arrived.notify_all()

    def publish(self, is_latched=False):
        """Connect a publisher; return its socket, rospy's connection and rospy's thread."""
        ours, theirs = socket.socketpair()
        connection = TCPROSTransport(TCPROSSub("/topic", RAW_CLASS, queue_size=50), "/topic")
        connection.socket = ours
        connection.is_latched = is_latched
        connection.header = {"callerid": "/publisher"}
        connection.set_endpoint_id("http://publisher:%d/" % theirs.fileno())
        assert self.impl.add_connection(connection)
        thread = threading.Thread(target=connection.receive_loop, args=(self.impl.receive_callback,), daemon=True)
        thread.start()
        return theirs, connection, thread

    def publish_adopted(self):
        """As publish(), after the loop has taken over."""
        before = set(self.loop._readers)
        publisher, connection, thread = self.publish()
        deadline_s = time.monotonic() + DEADLINE_S
        while self.loop._readers == before:
            assert time.monotonic() < deadline_s
            count = len(self.received)
            publisher.sendall(frame(b"hello"))
            self.wait_for(count + 1)
        return publisher, connection, thread

    def wait_for(self, count):
        with self.arrived:
            assert self.arrived.wait_for(lambda: len(self.received) >= count, DEADLINE_S), self.received

    def list_payloads(self):
        return [payload for payload, _ in self.received]

    def close(self):
        self.loop.stop()
        self.loop_thread.join(DEADLINE_S)


@pytest.fixture
def bench(monkeypatch):
    bench = Bench(monkeypatch)
    yield bench
    bench.close()


def wait_until_ended(thread):
    thread.join(DEADLINE_S)
    assert not thread.is_alive()


def test_all_messages_are_received_on_the_thread_of_the_sockets(bench):
    publisher, connection, _ = bench.publish_adopted()
    before = len(bench.received)
    messages_before = connection.stat_num_msg
    for number in range(100):
        publisher.sendall(frame(b"%d" % number))
    bench.wait_for(before + 100)
    assert bench.received[before:] == [(b"%d" % number, True) for number in range(100)]
    assert connection.stat_num_msg == messages_before + 100


def test_messages_are_whole_and_in_order_however_they_are_cut(bench):
    messages = [b"x" * length for length in (0, 1, 3, 4, 5, 48, 5000)]
    publisher, _, _ = bench.publish_adopted()
    before = len(bench.received)
    for byte in b"".join(map(frame, messages)):
        publisher.sendall(bytes((byte,)))
    bench.wait_for(before + len(messages))
    assert bench.list_payloads()[before:] == messages


def test_what_rospy_has_read_comes_first_and_nothing_is_lost(bench):
    publisher, _, _ = bench.publish()
    stream = b"".join(frame(b"%d" % number) for number in range(10)) + frame(b"a message in two parts")
    publisher.sendall(stream[:-5])
    bench.wait_for(10)
    publisher.sendall(stream[-5:])
    bench.wait_for(11)
    publisher.sendall(frame(b"last"))
    bench.wait_for(12)
    assert bench.list_payloads() == [
        *[b"%d" % number for number in range(10)],
        b"a message in two parts",
        b"last",
    ]


def test_several_publishers_of_one_topic_are_all_heard(bench):
    publishers = [bench.publish_adopted()[0] for _ in range(5)]
    before = len(bench.received)
    for number, publisher in enumerate(publishers):
        publisher.sendall(frame(b"%d" % number))
    bench.wait_for(before + 5)
    assert sorted(bench.list_payloads()[before:]) == [b"%d" % number for number in range(5)]


def test_a_publisher_that_goes_leaves_nothing_behind(bench):
    publisher, connection, thread = bench.publish_adopted()
    publisher.close()
    wait_until_ended(thread)
    assert connection.done
    assert not bench.loop._readers


def test_closing_the_inlet_ends_what_the_loop_reads(bench):
    _, connection, thread = bench.publish_adopted()
    bench.subscriber.close()
    wait_until_ended(thread)
    assert connection.done
    assert not bench.loop._readers
    bench.subscriber.close()
    before = bench.list_payloads()
    bench.subscriber.take(connection, b"was under way")
    assert bench.list_payloads() == before


def test_the_end_of_the_loop_lets_the_threads_of_rospy_go(bench):
    _, _, thread = bench.publish_adopted()
    bench.close()
    wait_until_ended(thread)


def test_a_publisher_that_does_not_speak_tcpros_is_closed_alone(bench):
    other, _, _ = bench.publish_adopted()
    publisher, _, thread = bench.publish_adopted()
    publisher.sendall(struct.pack("<I", MESSAGE_LENGTH_MAX + 1))
    wait_until_ended(thread)
    before = len(bench.received)
    other.sendall(frame(b"still here"))
    bench.wait_for(before + 1)
    assert bench.received[-1] == (b"still here", True)


def test_an_unusable_message_is_reported_and_ends_its_publisher_only(bench):
    other, _, _ = bench.publish_adopted()
    publisher, _, thread = bench.publish_adopted()
    bench.fails_on = b"bad"
    publisher.sendall(frame(b"bad"))
    wait_until_ended(thread)
    assert [str(fault) for fault in bench.handler.faults] == ["not this one"]
    before = len(bench.received)
    other.sendall(frame(b"still here"))
    bench.wait_for(before + 1)


def test_rospy_keeps_reading_where_topic_statistics_are_wanted(bench, monkeypatch):
    class Statistics:
        def callback(self, message, publisher, length):
            """Count nothing."""

        def shutdown(self):
            """End nothing."""

    monkeypatch.setattr(bench.impl, "statistics_logger", Statistics())
    publisher, _, _ = bench.publish()
    for number in range(20):
        publisher.sendall(frame(b"%d" % number))
    bench.wait_for(20)
    assert bench.list_payloads() == [b"%d" % number for number in range(20)]
    assert not bench.loop._readers


def uri_of(publisher):
    return "http://publisher:%d/" % publisher.fileno()


@pytest.mark.parametrize(
    ("is_latched", "was_there", "is_old"), [(True, True, True), (True, False, False), (False, True, False)]
)
def test_only_what_a_publisher_had_latched_before_the_subscription_is_old(bench, is_latched, was_there, is_old):
    publisher, _, _ = bench.publish(is_latched)
    bench.subscriber._earlier = frozenset([uri_of(publisher)]) if was_there else frozenset(["http://other/"])
    publisher.sendall(frame(b"first"))
    bench.wait_for(1)
    publisher.sendall(frame(b"second"))
    bench.wait_for(2)
    assert bench.old == [b"first"] * is_old


def test_where_the_master_cannot_be_asked_all_that_is_latched_is_old(bench):
    publisher, _, _ = bench.publish(is_latched=True)
    bench.subscriber._earlier = None
    publisher.sendall(frame(b"first"))
    bench.wait_for(1)
    assert bench.old == [b"first"]


def test_a_message_that_came_through_rospy_has_its_sender_too():
    loop = SimpleNamespace(has_resumed_within=lambda duration_s: False)
    senders = []
    subscriber = RawSubscriber(lambda payload: senders.append((payload, subscriber.last_sender)), loop)
    connection = SimpleNamespace(is_latched=False)
    subscriber.take(connection, b"first")
    assert senders == [(b"first", connection)] and not subscriber.is_old


def test_what_a_publisher_sent_while_the_driver_did_not_run_is_old(bench):
    publisher, _, _ = bench.publish_adopted()
    pauses, goes_on = threading.Event(), threading.Event()
    count = len(bench.received)

    def pause():
        pauses.set()
        goes_on.wait(DEADLINE_S)
        bench.loop._ran_s -= 3600.0

    bench.loop.call_soon(pause)
    assert pauses.wait(DEADLINE_S)
    texts = [b"%d" % number * 50 for number in range(100)]
    publisher.sendall(b"".join(map(frame, texts)))
    goes_on.set()
    bench.wait_for(count + len(texts))
    publisher.sendall(frame(b"new"))
    bench.wait_for(count + len(texts) + 1)
    assert bench.old == texts


def test_the_first_message_of_a_publisher_right_after_a_pause_is_old(bench):
    bench.loop._resumed_s = time.monotonic() + DEADLINE_S
    publisher, _, _ = bench.publish()
    publisher.sendall(frame(b"first"))
    bench.wait_for(1)
    bench.loop._resumed_s = time.monotonic() - raw_subscriber.RESUMED_S
    assert bench.old == [b"first"]


@pytest.mark.parametrize("at_once_length", [0, 1, 7, 15])
def test_a_message_that_was_begun_before_a_pause_counts_to_what_is_old(at_once_length):
    near, far = socket.socketpair()
    with near, far:
        old, subscriber = [], RawSubscriber(lambda payload: old.append((payload, subscriber.is_old)), None)
        long = b"l" * 300
        connection = SimpleNamespace(stat_bytes=0, stat_num_msg=0)
        stream = MessageStream(subscriber, connection, far, frame(long)[:250])
        near.sendall(frame(long)[250:] + frame(b"short") + frame(b"begun")[:2])
        stream.resume()
        later = frame(b"begun")[2:] + frame(b"newer") + frame(b"newest")
        near.sendall(later[:at_once_length])
        assert stream.read()
        near.sendall(later[at_once_length:])
        assert stream.read()
        assert old == [(long, True), (b"short", True), (b"begun", True), (b"newer", False), (b"newest", False)]
        assert (connection.stat_bytes, connection.stat_num_msg) == (54 + 9 + 9 + 9 + 10, 5)


def test_of_motion_commands_of_before_a_pause_all_are_passed_on():
    texts = [b"%05d" % number * 10 for number in range(1000)]
    near, far = socket.socketpair()
    with near, far:
        received = []
        subscriber = RawSubscriber(lambda payload: received.append((payload, subscriber.is_old)), None, moves=True)
        stream = MessageStream(subscriber, SimpleNamespace(stat_bytes=0, stat_num_msg=0), far, b"")
        near.sendall(b"".join(map(frame, texts)))
        stream.resume()
        assert stream.read() and stream.read()
        assert received == [(text, True) for text in texts]


def test_of_motion_commands_that_a_socket_has_piled_up_the_newest_counts():
    texts = [b"%05d" % number * 10 for number in range(1000)]
    for moves, reads_max in ((True, 2), (False, 1000)):
        near, far = socket.socketpair()
        with near, far:
            received, ended = [], []
            subscriber = RawSubscriber(received.append, None, lambda ended=ended: ended.append(True), moves=moves)
            connection = SimpleNamespace(stat_bytes=0, stat_num_msg=0)
            stream = MessageStream(subscriber, connection, far, b"")
            near.sendall(b"".join(map(frame, texts)))
            near.close()
            reads = 0
            while stream.read():
                reads += 1
            stream.close()
            assert reads <= reads_max and ended == [True] and connection.stat_num_msg == len(texts)
            first = raw_subscriber.READ_LENGTH // len(frame(texts[0]))
            assert received == ([*texts[:first], texts[-1]] if moves else texts)
