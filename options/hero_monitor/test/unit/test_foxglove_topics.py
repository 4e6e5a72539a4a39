"""The program foxglove: topics that come and go, types that differ, latched messages, a client of the real server."""

import asyncio
import json
import struct
import threading
from contextlib import nullcontext
from types import SimpleNamespace
from unittest.mock import create_autospec

import pytest

pytest.importorskip("rospy", reason="the program needs ROS")
from std_msgs.msg import ColorRGBA, String

from hero_monitor import foxglove as module
from hero_node import NodeError, ProgramError
from hero_node.parameters import check_parameters


class FakeSdk:
    """Stands for the SDK: channels that keep what is logged; clients want those of `wanted`."""

    def __init__(self):
        self.wanted, self.logged, self.open = set(), [], {}

    @staticmethod
    def Schema(*, name, encoding, data):  # noqa: N802 - the SDK's name
        assert encoding == "ros1msg" and isinstance(data, bytes)
        return name, data

    def Channel(self, topic, *, schema, message_encoding):  # noqa: N802
        assert message_encoding == "ros1" and topic not in self.open
        self.open[topic] = schema
        return SimpleNamespace(
            has_sinks=lambda: topic in self.wanted,
            log=lambda data: self.logged.append((topic, data)),
            close=lambda: self.open.pop(topic),
        )


@pytest.fixture(name="ros")
def fixture_ros(monkeypatch):
    """A ROS master with `published` topics, and the `callbacks` of what is subscribed."""
    ros = SimpleNamespace(published=[], callbacks={}, warnings=[], last={})

    def ask(method, subgraph):
        assert (method, subgraph) == ("getPublishedTopics", "")
        if ros.published is None:
            raise NodeError("no ROS master")
        return ros.published

    def subscribe(topic, kind, receive, argument, queue_size, tcp_nodelay):
        assert kind is module.rospy.AnyMsg and topic not in ros.callbacks and queue_size == 100 and tcp_nodelay
        ros.callbacks[topic] = lambda message: receive(message, argument)

        def unregister():
            take = ros.callbacks.pop(topic)
            if topic in ros.last:  # rospy's thread is just calling
                take(ros.last.pop(topic))

        return SimpleNamespace(unregister=unregister)

    monkeypatch.setattr(module, "ask_master", ask)
    monkeypatch.setattr(module.rospy, "Subscriber", subscribe)
    monkeypatch.setattr(module.rospy, "logwarn_throttle_identical", lambda *said: ros.warnings.append(said))
    return ros


def make_message(data, kind=String, **header):
    return SimpleNamespace(_buff=data, _connection_header={"md5sum": kind._md5sum, **header})


def test_topics_are_subscribed_to_while_a_client_wants_them(ros):
    sdk = FakeSdk()
    topics = module.TopicServer(sdk)
    ros.published = [["/b", "std_msgs/String"], ["/a", "std_msgs/String"], ["/c", "no_package/Thing"]]
    topics.look()
    assert list(sdk.open) == ["/a", "/b"]
    assert sdk.open == {topic: ("std_msgs/String", String._full_text.encode()) for topic in ("/a", "/b")}
    assert ros.callbacks == {}
    sdk.wanted = {"/a"}
    topics.look()
    topics.look()
    ros.callbacks["/a"](make_message(b"text"))
    assert sdk.logged == [("/a", b"text")] and list(ros.callbacks) == ["/a"]
    sdk.wanted = set()
    topics.look()
    assert ros.callbacks == {} and set(sdk.open) == {"/a", "/b"}


def test_a_topic_that_ends_or_changes_its_type_is_offered_anew(ros):
    sdk = FakeSdk()
    topics = module.TopicServer(sdk)
    ros.published = [["/a", "std_msgs/String"], ["/b", "std_msgs/String"]]
    sdk.wanted = {"/a", "/b"}
    topics.look()
    late = ros.callbacks["/b"]
    ros.published = [["/a", "std_msgs/ColorRGBA"]]
    topics.look()
    assert sdk.open == {"/a": ("std_msgs/ColorRGBA", ColorRGBA._full_text.encode())}
    late(make_message(b"late"))
    ros.callbacks["/a"](make_message(b"color", ColorRGBA))
    assert sdk.logged == [("/a", b"color")]


def test_topics_stay_while_the_master_is_away(ros):
    sdk = FakeSdk()
    topics = module.TopicServer(sdk)
    ros.published, sdk.wanted = [["/a", "std_msgs/String"]], {"/a"}
    topics.look()
    ros.published = None
    topics.look()
    assert list(sdk.open) == ["/a"] and list(ros.callbacks) == ["/a"]


def test_a_message_of_another_definition_is_named_and_not_shown(ros):
    sdk = FakeSdk()
    topics = module.TopicServer(sdk)
    ros.published, sdk.wanted = [["/a", "std_msgs/String"]], {"/a"}
    topics.look()
    ros.callbacks["/a"](make_message(b"other", ColorRGBA))
    ros.callbacks["/a"](make_message(b"text"))
    assert sdk.logged == [("/a", b"text")]
    assert ros.warnings == [(10.0, "/a has another std_msgs/String than this machine: it is not shown")]


def test_a_client_that_comes_later_gets_what_is_latched(ros):
    sdk = FakeSdk()
    topics = module.TopicServer(sdk)
    ros.published, sdk.wanted = [["/a", "std_msgs/String"], ["/b", "std_msgs/String"]], {"/a", "/b"}
    topics.look()
    ros.callbacks["/a"](make_message(b"kept", latching="1"))
    ros.callbacks["/b"](make_message(b"passing", latching="0"))
    for topic in ("/a", "/b"):
        topics.on_subscribe(SimpleNamespace(id=2), SimpleNamespace(topic=topic))
    topics.look()
    topics.look()
    assert sdk.logged == [("/a", b"kept"), ("/b", b"passing"), ("/a", b"kept")]


def test_what_was_latched_before_a_topic_was_left_is_never_sent_again(ros):
    sdk = FakeSdk()
    topics = module.TopicServer(sdk)
    ros.published, sdk.wanted = [["/a", "std_msgs/String"]], {"/a"}
    topics.look()
    ros.callbacks["/a"](make_message(b"first", latching="1"))
    ros.last["/a"] = make_message(b"last", latching="1")
    sdk.wanted = set()
    topics.look()
    sdk.wanted = {"/a"}
    topics.on_subscribe(SimpleNamespace(id=2), SimpleNamespace(topic="/a"))
    topics.look()
    assert sdk.logged == [("/a", b"first"), ("/a", b"last")]


class Program:
    """Runs for three looks."""

    def __init__(self, name):
        assert name == "foxglove"
        self.pauses_s = []

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.is_over = True

    def sleep(self, duration_s):
        self.pauses_s.append(duration_s)
        return len(self.pauses_s) <= 3


@pytest.mark.parametrize("error", [None, KeyboardInterrupt()])
def test_the_server_ends_with_the_program_whatever_ends_that(monkeypatch, error):
    steps, programs = [], []
    server = SimpleNamespace(stop=lambda: steps.append("stopped"))

    def start_server(*, name, host, port, server_listener):
        assert (host, port) == ("127.0.0.1", 8765) and isinstance(server_listener, module.TopicServer)
        return server

    def look(topics):
        steps.append("looked")
        if error is not None:
            raise error

    sdk = SimpleNamespace(start_server=start_server)
    monkeypatch.setattr(module, "Program", lambda name: programs.append(Program(name)) or programs[-1])
    monkeypatch.setattr(module, "read_parameters", lambda declared: check_parameters(declared, {}))
    monkeypatch.setattr(module, "import_optional", create_autospec(module.import_optional, return_value=sdk))
    monkeypatch.setattr(module.TopicServer, "look", look)
    with pytest.raises(KeyboardInterrupt) if error else nullcontext():
        module.main()
    assert steps == ["looked"] * (1 if error else 3) + ["stopped"] and programs[0].is_over
    assert set(programs[0].pauses_s) == {0.5}
    module.import_optional.assert_called_once_with("foxglove", "foxglove-sdk")

    def refuse(**options):
        raise RuntimeError("Address already in use")

    sdk.start_server = refuse
    with pytest.raises(ProgramError, match="ws://127.0.0.1:8765 cannot be served: Address already in use"):
        module.main()
    assert steps[-1] == "stopped" and len(steps) < 5 and programs[1].is_over


def test_its_port_is_any_that_tcp_has():
    for port in (1, 65535):
        assert check_parameters(module.PARAMETERS, {"port": port})["port"] == port
    for port in (0, 65536):
        with pytest.raises(ProgramError, match="port"):
            check_parameters(module.PARAMETERS, {"port": port})


@pytest.mark.option("foxglove")
def test_a_client_of_the_server_reads_the_bytes_of_a_topic(ros):
    import foxglove as sdk
    import tornado.websocket

    topics = module.TopicServer(sdk)
    server = sdk.start_server(name="topics", host="127.0.0.1", port=0, server_listener=topics)
    ros.published = [["/option/a", "std_msgs/String"]]
    topics.look()

    async def read():
        url = "ws://127.0.0.1:%d" % server.port
        socket = await tornado.websocket.websocket_connect(url, subprotocols=["foxglove.sdk.v1"])
        while True:
            message = json.loads(await socket.read_message())
            if message["op"] == "advertise":
                break
        (channel,) = message["channels"]
        wish = {"op": "subscribe", "subscriptions": [{"id": 7, "channelId": channel["id"]}]}
        await socket.write_message(json.dumps(wish))
        while "/option/a" not in ros.callbacks:
            await asyncio.sleep(0)
            topics.look()
        sender = threading.Thread(target=ros.callbacks["/option/a"], args=(make_message(b"bytes"),))
        sender.start()
        return channel, await socket.read_message()

    try:
        channel, data = asyncio.run(asyncio.wait_for(read(), 30.0))
    finally:
        server.stop()
    assert (channel["encoding"], channel["schemaEncoding"]) == ("ros1", "ros1msg")
    assert (channel["schemaName"], channel["schema"]) == ("std_msgs/String", String._full_text)
    assert struct.unpack("<BI", data[:5]) == (1, 7) and data[13:] == b"bytes"
