"""Clients of /foxglove, without a network: what they are offered, who gets what, what is dropped, how long it lasts."""

import json
import struct
from concurrent.futures import Future
from types import SimpleNamespace
from unittest import mock

import pytest
import tornado.websocket

from hero_monitor.foxglove import endpoint as module
from hero_monitor.foxglove.endpoint import FoxgloveEndpoint, FoxgloveSocket
from hero_monitor.foxglove.topics import Channel, RosTopics


def make_channel(number, topic, type_name="std_msgs/Bool", definition="bool data\n"):
    return Channel(number, topic, type_name, definition, "md5")


POSE = make_channel(1, "/pose", "geometry_msgs/Pose2D", "float64 x\nfloat64 y\nfloat64 theta\n")
FLAG = make_channel(2, "/flag")


class Tick:
    """A PeriodicCallback that never calls."""

    def __init__(self, call, period_ms):
        self.is_on = False
        self.start, self.stop = (lambda: setattr(self, "is_on", True)), (lambda: setattr(self, "is_on", False))

    def is_running(self):
        return self.is_on


@pytest.fixture(name="endpoint")
def make_endpoint(monkeypatch):
    """An endpoint with two topics; messages are put into topics.taken."""
    monkeypatch.setattr(module.tornado.ioloop, "PeriodicCallback", Tick)
    monkeypatch.setattr(module.time, "time_ns", lambda: 1700000000123456789)
    topics = mock.create_autospec(RosTopics, instance=True)
    topics.channels, topics.taken = {1: POSE, 2: FLAG}, []
    topics.take.side_effect = lambda: [topics.taken.pop(0) for _ in list(topics.taken)]
    topics.find_latched.return_value = []
    topics.want.return_value = True
    return FoxgloveEndpoint(topics, [])


class Client(FoxgloveSocket):
    """The socket of a client that keeps what it is sent."""

    def __init__(self, endpoint):
        self.endpoint, self.texts, self.writes, self.has_received = endpoint, [], [], True
        self.ws_connection = SimpleNamespace(stream=SimpleNamespace(write=self.keep))
        self.open()
        endpoint._update()

    def set_nodelay(self, value):
        pass

    def write_message(self, message, binary=False):
        self.texts.append(json.loads(message))
        return Future()

    def keep(self, data):
        self.writes.append(data)
        return SimpleNamespace(done=lambda: self.has_received)

    def find(self, op):
        return [text for text in self.texts if text["op"] == op]

    def request(self, **request):
        self.on_message(json.dumps(request))

    def subscribe(self, number, channel):
        self.request(op="subscribe", subscriptions=[{"id": number, "channelId": channel.id}])

    def take(self):
        """Return the messages that were sent as (opcode, subscription, time in ns, content)."""
        data, messages = b"".join(self.writes), []
        self.writes.clear()
        while data:
            message, data = split_frame(data)
            messages.append((*struct.unpack("<BIQ", message[:13]), message[13:]))
        return messages


def split_frame(data):
    """Return what a whole, unmasked, binary frame of a WebSocket carries (RFC 6455, 5.2), and what is behind it."""
    assert data[0] == 0x82
    form, size = {126: ("!H", 2), 127: ("!Q", 8)}.get(data[1], ("", 0))
    end = 2 + size + (struct.unpack_from(form, data, 2)[0] if size else data[1])
    assert len(data) >= end
    return data[2 + size : end], data[end:]


def deliver(endpoint, *messages):
    endpoint.topics.taken += messages
    endpoint._update()


def test_a_client_is_greeted_with_all_topics_and_their_definitions(endpoint):
    client = Client(endpoint)
    assert client.texts[0]["op"] == "serverInfo"
    assert client.texts[0]["capabilities"] == []
    (offers,) = client.find("advertise")
    assert offers["channels"][0] == {
        "id": POSE.id,
        "topic": "/pose",
        "encoding": "ros1",
        "schemaName": POSE.type,
        "schema": POSE.definition,
        "schemaEncoding": "ros1msg",
    }
    assert [offer["topic"] for offer in offers["channels"]] == ["/pose", "/flag"]


def test_bytes_reach_only_subscribers_with_their_own_number(endpoint):
    first, second = Client(endpoint), Client(endpoint)
    first.subscribe(7, POSE)
    second.subscribe(9, FLAG)
    deliver(endpoint, (POSE, b"\x00\xff"))
    assert first.take() == [(1, 7, 1700000000123456789, b"\x00\xff")]
    assert second.take() == []


def test_topics_are_wanted_while_a_client_subscribes(endpoint):
    client = Client(endpoint)
    client.subscribe(1, POSE)
    client.subscribe(2, FLAG)
    endpoint._update()
    endpoint.topics.want.assert_called_with({POSE, FLAG})
    client.request(op="unsubscribe", subscriptionIds=[2])
    endpoint._update()
    endpoint.topics.want.assert_called_with({POSE})
    client.on_close()
    endpoint._update()
    endpoint.topics.want.assert_called_with(set())


def test_topics_are_looked_up_until_the_last_one_is_closed(endpoint):
    client = Client(endpoint)
    assert endpoint._tick.is_on
    for _ in range(2):
        client.on_close()
    endpoint.topics.want.return_value = False
    endpoint._update()
    assert endpoint._tick.is_on, "one is still being connected to"
    endpoint.topics.want.return_value = True
    endpoint._update()
    assert not endpoint._tick.is_on


def test_topics_that_appear_and_vanish_are_told_to_connected_clients(endpoint):
    client, new = Client(endpoint), make_channel(3, "/new")
    client.subscribe(1, FLAG)
    endpoint.topics.channels = {1: POSE, 3: new}
    endpoint._update()
    assert [offer["topic"] for offer in client.find("advertise")[-1]["channels"]] == ["/new"]
    assert client.find("unadvertise") == [{"op": "unadvertise", "channelIds": [2]}]
    endpoint.topics.want.assert_called_with(set())


def test_a_later_client_gets_latched_messages_too(endpoint):
    endpoint.topics.find_latched.side_effect = lambda channel: [b"latched"] if channel is POSE else []
    client = Client(endpoint)
    client.subscribe(2, POSE)
    client.subscribe(3, FLAG)
    endpoint._update()
    assert [(number, content) for _, number, _, content in client.take()] == [(2, b"latched")]


def test_a_slow_client_loses_the_oldest_and_others_lose_nothing(endpoint, monkeypatch):
    monkeypatch.setattr(module, "QUEUE_BYTES_MAX", 100)
    slow, fast = Client(endpoint), Client(endpoint)
    for client in (slow, fast):
        client.subscribe(1, POSE)
    slow.has_received = False
    for number in range(50):
        deliver(endpoint, (POSE, b"%07d" % number))
    slow.has_received = True
    endpoint._update()
    assert [int(content) for *_, content in slow.take()] == [0, 46, 47, 48, 49]
    assert [int(content) for *_, content in fast.take()] == list(range(50))
    assert ["dropped" in text["message"] for text in slow.find("status")] == [True]


def test_a_client_that_still_receives_gets_the_rest_in_one_write_later(endpoint):
    client = Client(endpoint)
    client.subscribe(1, POSE)
    client.has_received = False
    deliver(endpoint, (POSE, b"a"), (POSE, b"b"))
    assert len(client.writes) == 1
    deliver(endpoint, (POSE, b"c"))
    deliver(endpoint, (POSE, b"d"))
    assert len(client.writes) == 1
    client.has_received = True
    endpoint._update()
    assert len(client.writes) == 2
    assert [content for *_, content in client.take()] == [b"a", b"b", b"c", b"d"]


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}",
        "null",
        "[" * 100000,
        '{"op": "subscribe"}',
        '{"op": "subscribe", "subscriptions": [{"id": -1, "channelId": 1}]}',
        '{"op": "subscribe", "subscriptions": [{"id": 1, "channelId": "1"}]}',
        '{"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 4000000000}]}',
        '{"op": "unsubscribe", "subscriptionIds": 3}',
        '{"op": "advertise", "channels": []}',
        '{"op": "subscribeConnectionGraph"}',
        b"\x01whatever",
        b"\x01",
    ],
)
def test_other_requests_are_answered_by_a_status_once_in_a_row(endpoint, text):
    client = Client(endpoint)
    for _ in range(2):
        client.on_message(text)
    assert len(client.find("status")) == 1
    assert client.subscriptions == {}
    client.request(op="unsubscribe", subscriptionIds=[])
    client.on_message(text)
    assert len(client.find("status")) == 2


def test_a_client_has_so_many_subscriptions_each_with_a_number(endpoint, monkeypatch):
    monkeypatch.setattr(module, "SUBSCRIPTIONS_MAX", 2)
    client = Client(endpoint)

    def ask(**request):
        before = len(client.find("status"))
        client.request(**request)
        return [text["message"] for text in client.find("status")[before:]]

    assert ask(op="subscribe", subscriptions=[{"id": number, "channelId": 1} for number in (5, 6, 7)]) == [
        "subscriptions refused: [7]"
    ]
    assert ask(op="unsubscribe", subscriptionIds=[5]) == [] and client.subscriptions == {6: POSE}
    assert ask(op="subscribe", subscriptions=[{"id": 6, "channelId": 1}, {"id": 8, "channelId": 9}]) == [
        "subscriptions refused: [6, 8]"
    ]


@pytest.mark.parametrize("length", [0, 112, 113, 65522, 65523, 70000])
def test_messages_of_every_length_are_whole_frames(endpoint, length):
    client = Client(endpoint)
    client.subscribe(1, POSE)
    deliver(endpoint, (POSE, bytes(length)))
    assert [content for *_, content in client.take()] == [bytes(length)]


def test_a_client_that_has_gone_meanwhile_is_told_nothing(endpoint, monkeypatch):
    client = Client(endpoint)
    gone = mock.create_autospec(client.write_message, side_effect=tornado.websocket.WebSocketClosedError)
    monkeypatch.setattr(client, "write_message", gone)
    client.on_message("")
    assert gone.called
