"""Texts and frames of the Foxglove WebSocket protocol, version 1, as far as a server of topics needs them. Pure.

Source: https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md
"""

import json
import struct
from typing import Any, Iterable, List, NamedTuple, Tuple, Union

SUBPROTOCOLS = ("foxglove.sdk.v1", "foxglove.websocket.v1")
"""Both carry the messages below."""

INFO, WARNING, ERROR = 0, 1, 2
"""Levels of a status."""

MESSAGE_DATA = 0x01
_HEADER = struct.Struct("<BIQ")  # opcode, id of the subscription, time of arrival in ns
_CLIENT_HEADER = struct.Struct("<BI")  # opcode, id of the client's channel
_BINARY = 0x82  # first byte of a WebSocket frame that is a whole binary message
_SHORT_FRAME, _FRAME, _LONG_FRAME = struct.Struct("!BB"), struct.Struct("!BBH"), struct.Struct("!BBQ")



class ProtocolError(Exception):
    """A client sent what is not a request; the message says why."""


class Channel(NamedTuple):
    """A topic that clients can subscribe to, or that a client publishes."""

    id: int
    topic: str
    type: str
    definition: str


class Request(NamedTuple):
    """Message of a client."""

    op: str
    subscriptions: List[Tuple[int, int]] = []
    """Of subscribe: ids of subscription and channel; of unsubscribe: id of the subscription, and 0."""
    channels: List[Channel] = []
    """Of advertise, without definitions; of unadvertise, only with ids."""
    channel_id: int = 0
    content: bytes = b""
    """Of publish."""


def make_server_info(takes_messages: bool) -> str:
    """Return the greeting; clients never call services."""
    info = {"op": "serverInfo", "name": "hero_monitor", "metadata": {}, "supportedEncodings": ["ros1"]}
    return json.dumps({**info, "capabilities": ["clientPublish"] if takes_messages else []})


def make_advertise(channels: Iterable[Channel]) -> str:
    """Return the text that offers channels."""
    offers = [
        {
            "id": channel.id,
            "topic": channel.topic,
            "encoding": "ros1",
            "schemaName": channel.type,
            "schema": channel.definition,
            "schemaEncoding": "ros1msg",
        }
        for channel in channels
    ]
    return json.dumps({"op": "advertise", "channels": offers})


def make_unadvertise(ids: Iterable[int]) -> str:
    """Return the text that withdraws channels."""
    return json.dumps({"op": "unadvertise", "channelIds": sorted(ids)})


def make_status(level: int, text: str) -> str:
    """Return a line for the users of a client."""
    return json.dumps({"op": "status", "level": level, "message": text})


def encode_message(subscription: int, time_ns: int, content: bytes) -> bytes:
    """Return the WebSocket frame that carries a message, as servers send it: whole and not masked (RFC 6455, 5.2)."""
    length = _HEADER.size + len(content)
    if length < 126:
        head = _SHORT_FRAME.pack(_BINARY, length)
    elif length < 65536:
        head = _FRAME.pack(_BINARY, 126, length)
    else:
        head = _LONG_FRAME.pack(_BINARY, 127, length)
    return head + _HEADER.pack(MESSAGE_DATA, subscription, time_ns) + content


def read_request(message: Union[str, bytes]) -> Request:
    """Parse what a client sent. Raises: ProtocolError."""
    if isinstance(message, bytes):
        if len(message) < _CLIENT_HEADER.size or message[0] != MESSAGE_DATA:
            raise ProtocolError("invalid request: neither text nor a message")
        channel_id = _CLIENT_HEADER.unpack_from(message)[1]
        return Request("publish", channel_id=channel_id, content=message[_CLIENT_HEADER.size :])
    try:
        value = json.loads(message)
        op = value["op"]
        if op == "subscribe":
            return Request(op, [(_read_id(each["id"]), _read_id(each["channelId"])) for each in value["subscriptions"]])
        if op == "unsubscribe":
            return Request(op, [(_read_id(each), 0) for each in value["subscriptionIds"]])
        if op == "advertise":
            return Request(op, channels=[_read_channel(each) for each in value["channels"]])
        if op == "unadvertise":
            return Request(op, channels=[Channel(_read_id(each), "", "", "") for each in value["channelIds"]])
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise ProtocolError("invalid request: %s" % type(error).__name__) from None
    return Request(str(op)[:40])


def _read_channel(value: Any) -> Channel:
    topic, kind, encoding = (str(value[name]) for name in ("topic", "schemaName", "encoding"))
    if encoding != "ros1":
        raise ProtocolError("%s: this server takes messages as ros1, not as %s" % (topic[:80], encoding[:40]))
    return Channel(_read_id(value["id"]), topic, kind, "")


def _read_id(value: Any) -> int:
    if type(value) is not int or not 0 <= value < 2**32:
        raise ValueError(value)
    return value
