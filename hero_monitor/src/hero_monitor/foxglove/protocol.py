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

SERVER_INFO = json.dumps(
    {"op": "serverInfo", "name": "hero_monitor", "capabilities": [], "supportedEncodings": ["ros1"], "metadata": {}}
)
"""Without capabilities: clients can neither publish nor call services."""


class ProtocolError(Exception):
    """A client sent what is not a request; the message says why."""


class Channel(NamedTuple):
    """A topic that clients can subscribe to."""

    id: int
    topic: str
    type: str
    definition: str


class Request(NamedTuple):
    """What a client sent."""

    op: str
    subscriptions: List[Tuple[int, int]]
    """Of subscribe: ids of subscription and channel; of unsubscribe: id of the subscription, and 0."""


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
    """Return a line for the people at a client."""
    return json.dumps({"op": "status", "level": level, "message": text})


def encode_message(subscription: int, time_ns: int, content: bytes) -> bytes:
    """Return the frame that carries a message."""
    return _HEADER.pack(MESSAGE_DATA, subscription, time_ns) + content


def read_request(message: Union[str, bytes]) -> Request:
    """Parse what a client sent. Raises: ProtocolError."""
    if isinstance(message, bytes):
        return Request("publish", [])  # all binary requests carry messages or calls, which no capability allows
    try:
        value = json.loads(message)
        op = value["op"]
        if op == "subscribe":
            return Request(op, [(_read_id(each["id"]), _read_id(each["channelId"])) for each in value["subscriptions"]])
        if op == "unsubscribe":
            return Request(op, [(_read_id(each), 0) for each in value["subscriptionIds"]])
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise ProtocolError("invalid request: %s" % type(error).__name__) from None
    return Request(str(op)[:40], [])


def _read_id(value: Any) -> int:
    if type(value) is not int or not 0 <= value < 2**32:
        raise ValueError(value)
    return value
