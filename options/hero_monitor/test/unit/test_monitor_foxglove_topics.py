"""Topics of ROS for Foxglove clients: publishers are found, connected to and read without waiting for any of them."""

import socket
import struct
from types import SimpleNamespace

import pytest
from rosgraph.network import encode_ros_handshake_header
from std_msgs.msg import Bool

from hero_monitor.foxglove import streams
from hero_monitor.foxglove import topics as module
from hero_monitor.foxglove.streams import MESSAGE_LENGTH_MAX, READ_LENGTH, Stream
from hero_monitor.foxglove.topics import LOOK_UP_PERIOD_S, RosTopics

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


class Ros:
    """A master, publishers and workers."""

    def __init__(self, monkeypatch, ends):
        self.now_s = 100.0
        self.jobs, self.publishers, self.failing = [], {}, set()
        self.types = [["/odd", "no_such/Type"], ["/flag", "std_msgs/Bool"]]
        self.nodes = [["/odd", ["/node"]], ["/flag", ["/node"]]]
        self.header = LATCHED
        self._ends = ends
        monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: self.now_s))
        monkeypatch.setattr(module, "ask_master", self.ask)
        monkeypatch.setattr(module, "open_stream", self.open)

    def ask(self, call, *arguments):
        answers = {"getPublishedTopics": self.types, "getSystemState": (self.nodes, [], []), "lookupNode": arguments}
        return answers[call]

    def open(self, topic, uri, own_name):
        (node,) = uri
        if node in self.failing:
            raise OSError("hangs")
        stream, self.publishers[topic, node] = self._ends(self.header)
        return stream

    def submit(self, function, *arguments):
        job = (function, arguments)
        self.jobs.append(job)
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
    """Topics that were looked up once."""
    topics = RosTopics(SimpleNamespace(submit=ros.submit, warn=lambda *said: None))
    topics.look_up()
    return topics


def find_channel(topics, topic):
    return next(channel for channel in topics.channels.values() if channel.topic == topic)


def connect(ros, topics, topic="/flag"):
    """Have a topic read; return its channel."""
    ros.work()
    channel = find_channel(topics, topic)
    assert not topics.want({channel})
    ros.work()
    return channel


def look_up_again(ros, topics):
    ros.now_s += 1.1 * LOOK_UP_PERIOD_S
    topics.look_up()
    ros.work()


def test_topics_are_looked_up_in_the_background_if_their_type_is_known(ros, topics):
    ros.now_s += 2.0 * LOOK_UP_PERIOD_S
    topics.look_up()
    assert topics.channels == {} and len(ros.jobs) == 1, "the master is asked one question at a time"
    ros.work()
    assert [channel.topic for channel in topics.channels.values()] == ["/flag"]
    topics.look_up()
    ros.work()
    ros.now_s += 0.9 * LOOK_UP_PERIOD_S
    topics.look_up()
    assert ros.jobs == []


def test_a_topic_stays_a_channel_until_it_has_another_type(ros, topics):
    ros.work()
    before = find_channel(topics, "/flag")
    look_up_again(ros, topics)
    assert find_channel(topics, "/flag") is before
    ros.types = [["/flag", "std_msgs/String"]]
    look_up_again(ros, topics)
    now = find_channel(topics, "/flag")
    assert now.id != before.id and (now.type, now.definition) == ("std_msgs/String", "string data\n")


def test_a_wanted_topic_is_read_until_it_is_wanted_no_more(ros, topics):
    channel = connect(ros, topics)
    assert topics.want({channel})
    ros.publishers["/flag", "/node"].send(frame(b"\1"))
    assert list(topics.take()) == [(channel, b"\1")] and list(topics.take()) == []
    assert topics.want(set())
    assert ros.publishers["/flag", "/node"].recv(1) == b""


def test_bytes_of_another_definition_are_dropped(ros, topics):
    ros.header = {**LATCHED, "md5sum": "another"}
    channel = connect(ros, topics)
    ros.publishers["/flag", "/node"].send(frame(b"\1"))
    assert list(topics.take()) == [] and topics.find_latched(channel) == []


@pytest.mark.parametrize(("latching", "kept"), [("1", [b"new"]), ("0", [])])
def test_the_newest_latched_message_is_kept_while_its_topic_is_read(ros, topics, latching, kept):
    ros.header = {**LATCHED, "latching": latching}
    channel = connect(ros, topics)
    ros.publishers["/flag", "/node"].send(frame(b"old") + frame(b"new"))
    assert [content for _, content in topics.take()] == [b"old", b"new"]
    assert topics.find_latched(channel) == kept
    topics.want(set())
    assert topics.find_latched(channel) == []


def test_a_publisher_that_restarts_is_connected_to_again(ros, topics):
    channel = connect(ros, topics)
    ros.publishers["/flag", "/node"].close()
    assert list(topics.take()) == []
    assert not topics.want({channel})
    ros.work()
    ros.publishers["/flag", "/node"].send(frame(b"\0"))
    assert list(topics.take()) == [(channel, b"\0")]


def test_nodes_that_fail_hinder_no_others_and_are_tried_again(ros, topics):
    ros.nodes = [["/flag", ["/a", "/b", "/c", "/d"]]]
    ros.failing = {"/a", "/b", "/c"}
    channel = connect(ros, topics)
    assert set(ros.publishers) == {("/flag", "/d")}
    ros.failing = set()
    assert not topics.want({channel}) and not topics.want({channel})
    assert len(ros.jobs) == 1
    ros.work()
    assert len(ros.publishers) == 4 and topics.want({channel})


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
    monkeypatch.setattr(streams.xmlrpc.client, "ServerProxy", Node((0, "not a publisher of [/flag]", 0)))
    with pytest.raises(OSError, match="not a publisher"):
        streams.open_stream("/flag", "http://localhost:1", "/monitor")


def test_a_connection_stays_open_unless_its_header_is_an_error(monkeypatch):
    monkeypatch.setattr(streams.xmlrpc.client, "ServerProxy", Node((1, "", ["TCPROS", "localhost", 1])))
    for header in (LATCHED, {"error": "another md5sum"}):
        ours, theirs = socket.socketpair()
        monkeypatch.setattr(streams.socket, "create_connection", lambda *arguments, ours=ours: ours)
        theirs.sendall(encode_ros_handshake_header(header) + frame(b"latched"))
        if "error" in header:
            with pytest.raises(OSError, match="another md5sum"):
                streams.open_stream("/flag", "http://localhost:1", "/monitor")
            assert ours.fileno() == -1
        else:
            stream = streams.open_stream("/flag", "http://localhost:1", "/monitor")
            assert stream.header == header and stream.read() == [b"latched"]
            stream.close()
        theirs.close()
