"""Topics for Foxglove clients, without sockets: what is offered, who gets what, what is dropped."""

import json
import struct

import pytest

from hero_monitor.foxglove import hub as hub_module
from hero_monitor.foxglove.hub import Client, Hub, TopicMessage, TopicType

POSE = TopicType("geometry_msgs/Pose2D", "float64 x\nfloat64 y\nfloat64 theta\n")
FLAG = TopicType("std_msgs/Bool", "bool data\n")


class Reader:
    """A client that keeps what it is sent."""

    def __init__(self, hub):
        self.texts = []
        self.hub = hub
        self.client = Client(lambda text: self.texts.append(json.loads(text)))
        hub.add(self.client)

    def find(self, op):
        return [text for text in self.texts if text["op"] == op]

    def channel(self, topic):
        offers = [offer for text in self.find("advertise") for offer in text["channels"]]
        return next(offer for offer in reversed(offers) if offer["topic"] == topic)

    def subscribe(self, number, topic):
        channel_id = self.channel(topic)["id"]
        self.send(op="subscribe", subscriptions=[{"id": number, "channelId": channel_id}])

    def send(self, **request):
        self.hub.receive(self.client, json.dumps(request))

    def take(self):
        """Return messages as (opcode, subscription, time in ns, content)."""
        messages = [read_frame(frame) for frame in self.client.take()]
        return [(*struct.unpack("<BIQ", message[:13]), message[13:]) for message in messages]


def read_frame(frame):
    """Return what a whole, unmasked, binary frame of a WebSocket carries (RFC 6455, 5.2)."""
    assert frame[0] == 0x82
    form, size = {126: ("!H", 2), 127: ("!Q", 8)}.get(frame[1], ("", 0))
    length = struct.unpack_from(form, frame, 2)[0] if size else frame[1]
    assert len(frame) == 2 + size + length
    return frame[2 + size :]


def make_message(topic, content=b"content", time_ns=5, latched_by=""):
    return TopicMessage(topic, content, time_ns, latched_by)


@pytest.fixture
def hub():
    made = Hub()
    made.update_topics({"/pose": POSE, "/flag": FLAG})
    return made


def test_a_client_is_greeted_with_all_topics_and_their_definitions(hub):
    reader = Reader(hub)
    assert reader.texts[0]["op"] == "serverInfo"
    assert reader.texts[0]["capabilities"] == []
    offer = reader.channel("/pose")
    assert (offer["encoding"], offer["schemaEncoding"]) == ("ros1", "ros1msg")
    assert (offer["schemaName"], offer["schema"]) == tuple(POSE)


def test_bytes_reach_only_subscribers_with_their_own_number(hub):
    first, second = Reader(hub), Reader(hub)
    first.subscribe(7, "/pose")
    second.subscribe(9, "/flag")
    hub.deliver([make_message("/pose", b"\x00\xff", time_ns=1700000000123456789)])
    assert first.take() == [(1, 7, 1700000000123456789, b"\x00\xff")]
    assert second.take() == []


def test_topics_are_wanted_only_while_someone_subscribes(hub):
    reader = Reader(hub)
    assert hub.wanted_topics == set()
    reader.subscribe(1, "/pose")
    reader.subscribe(2, "/flag")
    assert hub.wanted_topics == {"/pose", "/flag"}
    reader.send(op="unsubscribe", subscriptionIds=[2])
    assert hub.wanted_topics == {"/pose"}
    hub.remove(reader.client)
    assert hub.wanted_topics == set()


def test_topics_that_appear_and_vanish_are_told_to_connected_clients(hub):
    reader = Reader(hub)
    reader.subscribe(1, "/flag")
    flag_id = reader.channel("/flag")["id"]
    hub.update_topics({"/pose": POSE, "/new": FLAG})
    assert reader.channel("/new")["schemaName"] == "std_msgs/Bool"
    assert reader.find("unadvertise") == [{"op": "unadvertise", "channelIds": [flag_id]}]
    assert hub.wanted_topics == set()


def test_a_topic_with_another_type_is_another_channel(hub):
    reader = Reader(hub)
    old_id = reader.channel("/flag")["id"]
    hub.update_topics({"/pose": POSE, "/flag": POSE})
    assert reader.channel("/flag")["id"] != old_id
    assert reader.channel("/flag")["schemaName"] == POSE.name


def test_a_topic_that_comes_back_has_no_latched_message_of_its_former_type(hub):
    first, later = Reader(hub), Reader(hub)
    first.subscribe(1, "/flag")
    hub.deliver([make_message("/flag", b"a flag", latched_by="/a")])
    hub.update_topics({"/pose": POSE, "/flag": POSE})
    later.subscribe(2, "/flag")
    assert later.take() == []


def test_a_later_client_gets_latched_messages_too(hub):
    first, second = Reader(hub), Reader(hub)
    first.subscribe(1, "/pose")
    hub.deliver([make_message("/pose", b"old", latched_by="/a"), make_message("/pose", b"new", latched_by="/a")])
    second.subscribe(2, "/pose")
    assert [content for *_, content in second.take()] == [b"new"]


def test_latched_messages_are_kept_until_the_topic_is_unsubscribed(hub):
    first, second, third = Reader(hub), Reader(hub), Reader(hub)
    first.subscribe(1, "/pose")
    hub.deliver([make_message("/pose", b"old", latched_by="/a")])
    hub.remove(first.client)
    second.subscribe(2, "/pose")  # before the source has heard that the topic is not wanted any more
    assert [content for *_, content in second.take()] == [b"old"]
    hub.remove(second.client)
    hub.forget_latched()
    third.subscribe(3, "/pose")
    assert third.take() == []


def test_a_slow_client_loses_the_oldest_and_others_lose_nothing(hub, monkeypatch):
    monkeypatch.setattr(hub_module, "QUEUE_BYTES_MAX", 100)
    slow, fast = Reader(hub), Reader(hub)
    received = []
    for reader in (slow, fast):
        reader.subscribe(1, "/pose")
    for number in range(50):
        hub.deliver([make_message("/pose", b"%07d" % number)])
        received += fast.take()
    assert [int(content) for *_, content in slow.take()] == [46, 47, 48, 49]
    assert [int(content) for *_, content in received] == list(range(50))
    assert ["dropped" in text["message"] for text in slow.find("status")] == [True]


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
        b"\x02whatever",
        b"\x01",
    ],
)
def test_other_requests_are_answered_by_a_status_once_in_a_row(text):
    hub = Hub()
    reader = Reader(hub)
    for _ in range(2):
        hub.receive(reader.client, text)
    assert len(reader.find("status")) == 1
    assert hub.wanted_topics == set()
    reader.send(op="unsubscribe", subscriptionIds=[])
    hub.receive(reader.client, text)
    assert len(reader.find("status")) == 2


@pytest.mark.parametrize("length", [0, 112, 113, 65522, 65523, 70000])
def test_messages_of_every_length_are_whole_frames(hub, length):
    reader = Reader(hub)
    reader.subscribe(1, "/pose")
    hub.deliver([make_message("/pose", bytes(length))])
    assert reader.take() == [(1, 1, 5, bytes(length))]
