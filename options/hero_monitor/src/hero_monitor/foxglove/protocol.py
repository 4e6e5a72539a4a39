"""Channels and frames of the Foxglove WebSocket protocol, version 1, as far as a server of topics needs them. Pure.

Source: https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md
"""

import struct
from typing import Any, Dict, NamedTuple

SUBPROTOCOLS = ("foxglove.sdk.v1", "foxglove.websocket.v1")
"""Both carry the messages below."""

WARNING = 1
"""Level of a status."""

MESSAGE_DATA = 0x01
_HEADER = struct.Struct("<BIQ")  # opcode, id of the subscription, time of arrival in ns
_BINARY = 0x82  # first byte of a WebSocket frame that is a whole binary message
_SHORT_FRAME, _FRAME, _LONG_FRAME = struct.Struct("!BB"), struct.Struct("!BBH"), struct.Struct("!BBQ")


class Channel(NamedTuple):
    """A topic that clients can subscribe to."""

    id: int
    topic: str
    type: str
    definition: str


def describe_channel(channel: Channel) -> Dict[str, Any]:
    """Return a channel as servers advertise it."""
    names = {"id": channel.id, "topic": channel.topic, "schemaName": channel.type, "schema": channel.definition}
    return {**names, "encoding": "ros1", "schemaEncoding": "ros1msg"}


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
