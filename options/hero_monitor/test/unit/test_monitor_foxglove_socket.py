"""Who may connect to /foxglove; no network."""

import asyncio
from unittest import mock

import tornado.httputil
import tornado.web

from hero_monitor.foxglove.endpoint import CLIENTS_MAX, FoxgloveEndpoint, FoxgloveSocket
from hero_monitor.foxglove.topics import RosTopics
from hero_monitor.serving.access import Access
from hero_monitor.serving.client_limits import ClientLimits
from hero_monitor.serving.server import TOKEN_BURST
from hero_node import TokenBuckets

TOKEN = "a secret of more than sixteen letters"
LET_IN = 426
"""The answer to one that is let in, because it names no version of the protocol."""


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


def test_clients_need_the_token_the_protocol_and_an_admitted_origin():
    topics = mock.create_autospec(RosTopics, instance=True)
    endpoint, tokens = FoxgloveEndpoint(topics, ["https://Studio.example"]), make_buckets()
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
    endpoint.sockets = {FoxgloveSocket.__new__(FoxgloveSocket) for _ in range(CLIENTS_MAX)}
    assert CLIENTS_MAX == 10 and connect(endpoint, make_buckets(), uri=right) == 503
    endpoint.sockets.pop()
    assert connect(endpoint, make_buckets(), uri=right) == LET_IN


def test_the_newest_protocol_that_a_client_offers_is_taken():
    for offered, taken in ((["foxglove.websocket.v1", "foxglove.sdk.v1"], "foxglove.sdk.v1"), (["chat"], None)):
        assert FoxgloveSocket.select_subprotocol(None, offered) == taken
