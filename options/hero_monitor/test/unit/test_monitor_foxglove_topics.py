"""Topics of ROS for Foxglove clients: publishers are found, connected to and read without waiting for any of them."""

import socket
import struct
from types import SimpleNamespace

import pytest
from rosgraph.network import encode_ros_handshake_header
from std_msgs.msg import Bool

from hero_monitor.foxglove import ros_topics as module
from hero_monitor.foxglove import topic_streams
from hero_monitor.foxglove.ros_topics import LOOK_UP_PERIOD_S, OPENING_MAX, RosTopics
from hero_monitor.foxglove.topic_streams import MESSAGE_LENGTH_MAX, READ_LENGTH, Source, Stream, StreamSet

LATCHED = {"md5sum": Bool._md5sum, "latching": "1", "callerid": "/node"}


def frame(content):
    return struct.pack("<I", len(content)) + content


@pytest.fixture(name="ends")
def make_ends():
    """Return a function that makes a stream and the publisher's end of it."""
    opened = []

    def make(header=LATCHED, begun=b""):
        ours, theirs = socket.socketpair()
        opened.append(theirs)
        return Stream(ours, dict(header), begun), theirs

    yield make
    for each in opened:
        each.close()


def test_messages_are_complete_however_they_come(ends):
    stream, publisher = ends(begun=frame(b"begun")[:6])
    assert stream.read() == []
    publisher.send(frame(b"begun")[6:] + frame(b"") + frame(b"next")[:-1])
    assert stream.read() == [b"begun", b""]
    publisher.send(b"t")
    assert stream.read() == [b"next"] and stream.read() == []
    long = bytes(range(256)) * (READ_LENGTH // 200)
    publisher.setblocking(False)
    sent = publisher.send(frame(long))
    messages = stream.read()
    publisher.send(frame(long)[sent:])
    assert messages + stream.read() == [long]
    publisher.close()
    assert stream.is_open and stream.read() == [] and not stream.is_open


def test_a_publisher_that_announces_too_much_is_left(ends):
    stream, publisher = ends()
    publisher.send(frame(b"last") + struct.pack("<I", MESSAGE_LENGTH_MAX + 1))
    assert stream.read() == [b"last"] and not stream.is_open


def test_a_set_reads_what_is_ready_and_what_came_with_the_header(ends):
    streams = StreamSet()
    (first, publisher), (second, other) = ends(begun=frame(b"latched")), ends()
    streams.add(Source("/a", "/x"), first)
    streams.add(Source("/b", "/y"), second)
    assert streams.read() == [(Source("/a", "/x"), LATCHED, [b"latched"])]
    assert streams.read() == []
    other.send(frame(b"1"))
    publisher.close()
    assert streams.read() == [(Source("/b", "/y"), LATCHED, [b"1"])]
    assert list(streams) == [Source("/b", "/y")], "the publisher of /a has gone"
    streams.drop(Source("/b", "/y"))
    assert other.recv(1) == b""


class Ros:
    """A master, publishers and workers."""

    def __init__(self, monkeypatch, ends):
        self.now_s = 100.0
        self.jobs, self.publishers, self.failing = [], {}, set()
        self.types = [["/odd", "no_such/Type"], ["/flag", "std_msgs/Bool"]]
        self.nodes = [["/odd", ["/node"]], ["/flag", ["/node"]]]
        self._ends = ends
        monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: self.now_s, time_ns=lambda: 7))
        monkeypatch.setattr(module, "ask_master", self.ask)
        monkeypatch.setattr(module, "open_stream", self.open)

    def ask(self, call, *arguments):
        answers = {"getPublishedTopics": self.types, "getSystemState": (self.nodes, [], []), "lookupNode": arguments}
        return answers[call]

    def open(self, topic, uri, own_name):
        (node,) = uri
        if node in self.failing:
            raise OSError("hangs")
        stream, self.publishers[topic, node] = self._ends()
        return stream

    def submit(self, function, *arguments):
        self.jobs.append((function, arguments))
        job = self.jobs[-1]
        return SimpleNamespace(done=lambda: job not in self.jobs)

    def work(self):
        for function, arguments in list(self.jobs):
            function(*arguments)
            self.jobs.remove((function, arguments))


@pytest.fixture(name="ros")
def make_ros(monkeypatch, ends):
    return Ros(monkeypatch, ends)


@pytest.fixture(name="topics")
def make_topics(ros):
    topics = RosTopics(SimpleNamespace(submit=ros.submit, warn=lambda *said: None))
    topics.find_types()
    return topics


def test_topics_are_looked_up_in_the_background_if_their_type_is_known(ros, topics):
    ros.now_s += 2.0 * LOOK_UP_PERIOD_S
    assert topics.find_types() == {} and len(ros.jobs) == 1, "the master is asked one question at a time"
    ros.work()
    assert set(topics.find_types()) == {"/flag"}
    ros.work()
    ros.now_s += 0.9 * LOOK_UP_PERIOD_S
    topics.find_types()
    assert ros.jobs == []


def test_a_wanted_topic_is_read_until_it_is_wanted_no_more(ros, topics):
    ros.work()
    assert not topics.want({"/flag"})
    ros.work()
    assert topics.want({"/flag"})
    ros.publishers["/flag", "/node"].send(frame(b"\1"))
    assert topics.take() == [("/flag", b"\1", 7, "/node")] and topics.take() == []
    assert topics.want(set())
    assert ros.publishers["/flag", "/node"].recv(1) == b""


def test_bytes_of_another_definition_are_dropped(ros, topics):
    ros.work()
    topics._md5["/flag"] = "another"
    topics.want({"/flag"})
    ros.work()
    topics.want({"/flag"})
    ros.publishers["/flag", "/node"].send(frame(b"\1"))
    assert topics.take() == []


def test_a_publisher_that_restarts_is_found_by_the_next_look_up(ros, topics):
    ros.work()
    topics.want({"/flag"})
    ros.work()
    topics.want({"/flag"})
    ros.publishers["/flag", "/node"].close()
    topics.take()
    ros.now_s += 1.1 * LOOK_UP_PERIOD_S
    topics.find_types()
    ros.work()
    topics.want({"/flag"})
    ros.publishers["/flag", "/node"].send(frame(b"\0"))
    assert [message.content for message in topics.take()] == [b"\0"]


def test_nodes_that_fail_leave_workers_to_others_and_are_tried_later(ros, topics):
    ros.nodes = [["/flag", ["/a", "/b", "/c", "/d"]]]
    ros.failing = {"/a", "/b", "/c"}
    ros.work()
    topics.want({"/flag"})
    assert len(ros.jobs) == OPENING_MAX
    for _ in range(3):
        ros.work()
        topics.want({"/flag"})
    assert set(ros.publishers) == {("/flag", "/d")} and ros.jobs == []
    ros.failing = set()
    ros.now_s += 1.1 * LOOK_UP_PERIOD_S
    topics.find_types()
    ros.work()
    topics.want({"/flag"})
    assert len(ros.publishers) == 4


class Node:
    """Stands for the XML-RPC interface of a node."""

    def __init__(self, answer):
        self.answer = answer

    def __call__(self, *arguments, **options):
        return self

    def __enter__(self):
        return self

    def __exit__(self, *error):
        pass

    def requestTopic(self, *arguments):  # noqa: N802
        return self.answer


def test_a_refusal_of_a_publisher_is_an_error(monkeypatch):
    monkeypatch.setattr(topic_streams.xmlrpc.client, "ServerProxy", Node((0, "not a publisher of [/flag]", 0)))
    with pytest.raises(OSError, match="not a publisher"):
        topic_streams.open_stream("/flag", "http://localhost:1", "/monitor")


def test_a_connection_stays_open_unless_its_header_is_an_error(monkeypatch):
    monkeypatch.setattr(topic_streams.xmlrpc.client, "ServerProxy", Node((1, "", ["TCPROS", "localhost", 1])))
    for header in (LATCHED, {"error": "another md5sum"}):
        ours, theirs = socket.socketpair()
        monkeypatch.setattr(topic_streams.socket, "create_connection", lambda *arguments, ours=ours: ours)
        theirs.sendall(encode_ros_handshake_header(header) + frame(b"latched"))
        if "error" in header:
            with pytest.raises(OSError, match="another md5sum"):
                topic_streams.open_stream("/flag", "http://localhost:1", "/monitor")
            assert ours.fileno() == -1
        else:
            stream = topic_streams.open_stream("/flag", "http://localhost:1", "/monitor")
            assert stream.header == header and stream.read() == [b"latched"]
            stream.close()
        theirs.close()
