"""Who may connect to /foxglove, what a client that is slow gets, and how long topics are subscribed to; no network."""

import asyncio
from types import SimpleNamespace
from unittest import mock

import pytest
import tornado.httputil
import tornado.web

from hero_monitor.foxglove import endpoint as module
from hero_monitor.foxglove.endpoint import CLIENTS_MAX, FoxgloveEndpoint, FoxgloveSocket
from hero_monitor.foxglove.hub import Client, TopicMessage, TopicType
from hero_monitor.foxglove.ros_topics import RosTopics
from hero_monitor.serving.access import Access
from hero_monitor.serving.client_limits import ClientLimits
from hero_monitor.serving.server import TOKEN_BURST
from hero_node import TokenBuckets

TOKEN = "a secret of more than sixteen letters"
LET_IN = 426
"""The answer to one that is let in, because it names no version of the protocol."""


class Tick:
    """A PeriodicCallback that never calls."""

    def __init__(self, call, period_ms):
        self.is_on = False
        self.start, self.stop = (lambda: setattr(self, "is_on", True)), (lambda: setattr(self, "is_on", False))

    def is_running(self):
        return self.is_on


@pytest.fixture(name="topics")
def make_topics(monkeypatch):
    """Topics as RosTopics has them."""
    monkeypatch.setattr(module.tornado.ioloop, "PeriodicCallback", Tick)
    made = SimpleNamespace(wanted=[], is_done=True, messages=[], types={"/a": TopicType("std_msgs/Bool", "bool data")})

    def take():
        taken, made.messages = made.messages, []
        return taken

    made.source = mock.create_autospec(RosTopics, instance=True)
    made.source.find_types.side_effect = lambda: made.types
    made.source.want.side_effect = lambda topics: made.wanted.append(set(topics)) or made.is_done
    made.source.take.side_effect = take
    return made


def make_buckets():
    return TokenBuckets(TOKEN_BURST, 0.01)


def connect(
    endpoint, wrong_tokens, token=TOKEN, uri="/foxglove", protocol="foxglove.websocket.v1", origin=None, **headers
):
    """Return the status of the answer to a client that wants to connect."""
    connection = mock.Mock()
    all_headers = tornado.httputil.HTTPHeaders({"Host": "localhost", "Upgrade": "websocket", "Connection": "Upgrade"})
    for name, value in {"Sec-WebSocket-Protocol": protocol, "Origin": origin, **headers}.items():
        if value:
            all_headers.add(name, value)
    request = tornado.httputil.HTTPServerRequest(
        method="GET", uri=uri, host="localhost", headers=all_headers, connection=connection
    )
    request.remote_ip = "192.168.1.7"
    values = {**endpoint.route[2], "wrong_tokens": wrong_tokens}
    handler = FoxgloveSocket(
        tornado.web.Application(cookie_secret="secret"),
        request,
        access=Access(token, []),
        limits=ClientLimits(9),
        **values,
    )

    async def answer():
        await handler._execute([])  # tornado 5 gives no coroutine

    asyncio.run(answer())
    return connection.write_headers.call_args[0][0].code


def test_clients_need_the_token_the_protocol_and_an_admitted_origin(topics):
    endpoint, tokens = FoxgloveEndpoint(topics.source, ["https://Studio.example"]), make_buckets()
    right = "/foxglove?token=" + TOKEN.replace(" ", "%20")
    for changes, status in (
        ({"uri": right}, LET_IN),
        ({"token": None}, LET_IN),
        ({}, 403),
        ({"uri": "/foxglove?token=wrong"}, 403),
        ({"uri": right, "origin": "https://evil.example"}, 403),
        ({"uri": right, "origin": "http://localhost"}, LET_IN),
        ({"uri": right, "origin": "https://studio.example"}, LET_IN),
        ({"uri": right, "protocol": "chat"}, 400),
        ({"uri": right, "protocol": None}, 400),
        ({"uri": right, "protocol": "chat, foxglove.sdk.v1"}, LET_IN),
    ):
        assert connect(endpoint, tokens, **changes) == status, changes
    assert [connect(endpoint, tokens) for _ in range(TOKEN_BURST - 1)] == [403] * (TOKEN_BURST - 2) + [429]
    assert connect(endpoint, tokens, uri=right) == 429, "also with the right token"
    endpoint.hub.clients = {Client(lambda text: None) for _ in range(CLIENTS_MAX)}
    assert CLIENTS_MAX == 10 and connect(endpoint, make_buckets(), uri=right) == 503
    endpoint.hub.clients.pop()
    assert connect(endpoint, make_buckets(), uri=right) == LET_IN


def test_the_newest_protocol_that_a_client_offers_is_taken():
    for offered, taken in ((["foxglove.websocket.v1", "foxglove.sdk.v1"], "foxglove.sdk.v1"), (["chat"], None)):
        assert FoxgloveSocket.select_subprotocol(None, offered) == taken


def make_socket():
    socket = FoxgloveSocket.__new__(FoxgloveSocket)
    socket.texts, socket.written, socket.is_sent = [], [], True
    socket.client, socket._sending = Client(socket.texts.append), None

    def write(data):
        socket.written.append(data)
        return SimpleNamespace(done=lambda: socket.is_sent)

    socket.ws_connection = SimpleNamespace(stream=SimpleNamespace(write=write))
    return socket


def test_topics_are_subscribed_to_while_there_is_a_client(topics):
    endpoint, socket = FoxgloveEndpoint(topics.source, []), make_socket()
    endpoint.add(socket)
    assert endpoint._tick.is_on
    endpoint._update()
    endpoint.hub.receive(socket.client, '{"op": "subscribe", "subscriptions": [{"id": 3, "channelId": 1}]}')
    topics.messages = [TopicMessage("/a", b"\1", 5, "")]
    endpoint._update()
    assert topics.wanted[-1] == {"/a"} and len(socket.written) == 1
    for _ in range(2):
        endpoint.remove(socket)
    assert endpoint.hub.clients == set()
    topics.is_done, topics.types = False, {}
    endpoint._update()
    assert endpoint._tick.is_on and topics.wanted[-1] == set(), "until it is unsubscribed"
    topics.is_done = True
    endpoint._update()
    assert not endpoint._tick.is_on


def test_a_client_that_still_receives_gets_the_rest_in_one_write_later():
    socket = make_socket()
    socket.send_waiting()
    assert socket.written == []
    for content in (b"a", b"b"):
        socket.client.put(1, TopicMessage("/a", content, 5, ""))
    socket.is_sent = False
    socket.send_waiting()
    assert len(socket.written) == 1 and socket.written[0].endswith(b"b") and b"a" in socket.written[0]
    socket.client.put(1, TopicMessage("/a", b"c", 5, ""))
    socket.send_waiting()
    assert len(socket.written) == 1
    socket.is_sent = True
    socket.send_waiting()
    assert len(socket.written) == 2 and socket.written[1].endswith(b"c")
