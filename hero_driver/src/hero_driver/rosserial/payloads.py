"""Encodes and decodes the payloads of rosserial's own packets, little endian, in the order of their definitions."""

import struct
from typing import List, NamedTuple, Tuple

from hero_node.ros_messages import LENGTH, encode_text

from .packets import RosserialError

_UINT16 = struct.Struct("<H")
_INT32 = struct.Struct("<i")
_TIME = struct.Struct("<II")

LOG_DEBUG = 0
LOG_INFO = 1
LOG_WARN = 2
LOG_ERROR = 3
LOG_FATAL = 4


class PayloadError(RosserialError):
    """Bytes are not a payload of the kind that they were read as."""


class TopicInfo(NamedTuple):
    """Declaration of one topic, or of one direction of one service."""

    topic_id: int
    name: str  # as sent: with or without a leading slash
    message_type: str  # e.g. "nav_msgs/Odometry"
    md5sum: str  # 32 hexadecimal digits
    buffer_length: int  # bytes, the longest payload that the peer can hold


class Log(NamedTuple):
    """One log line of the peer."""

    level: int  # LOG_DEBUG..LOG_FATAL
    text: str


class WireTime(NamedTuple):
    """A point in time, as two unsigned 32-bit numbers; the robot asks for the time with zeros."""

    secs: int
    nsecs: int


def _read_texts(payload: bytes, start: int, count: int, what: str) -> Tuple[List[str], bytes]:
    """Return the texts from start on, and what follows them. Raises: PayloadError if payload is too short for them."""
    texts = []
    for _ in range(count):
        begin = start + LENGTH.size
        start = begin + int.from_bytes(payload[start:begin], "little")
        if max(begin, start) > len(payload):
            raise PayloadError(f"{what}: its texts need more than {len(payload)} bytes")
        # Peers are not trusted to send UTF-8: what cannot be read stays visible as an escape.
        texts.append(payload[begin:start].decode("utf-8", "backslashreplace"))
    return texts, payload[start:]


def encode_topic_info(info: TopicInfo) -> bytes:
    """Return the payload that declares info (packet ids 0..5 say in which direction)."""
    texts = map(encode_text, (info.name, info.message_type, info.md5sum))
    return b"".join((_UINT16.pack(info.topic_id), *texts, _INT32.pack(info.buffer_length)))


def decode_topic_info(payload: bytes) -> TopicInfo:
    """Return what payload declares. Raises: PayloadError if it is cut short or longer than its fields."""
    texts, remainder = _read_texts(payload, _UINT16.size, 3, "TopicInfo")
    if len(remainder) != _INT32.size:
        raise PayloadError(f"TopicInfo: {len(remainder)} bytes follow its texts instead of {_INT32.size}")
    return TopicInfo(*_UINT16.unpack_from(payload), *texts, *_INT32.unpack(remainder))


def encode_log(log: Log) -> bytes:
    """Return the payload of one log line."""
    return bytes((log.level,)) + encode_text(log.text)


def decode_log(payload: bytes) -> Log:
    """Return the log line in payload, color codes and all. Raises: PayloadError as decode_topic_info()."""
    texts, remainder = _read_texts(payload, 1, 1, "Log")
    if remainder:
        raise PayloadError(f"Log: {len(remainder)} bytes follow its text")
    return Log(payload[0], texts[0])


def encode_time(time: WireTime) -> bytes:
    """Return the eight bytes of time. Raises: PayloadError if a part does not fit 32 bits."""
    try:
        return _TIME.pack(time.secs, time.nsecs)
    except struct.error as error:
        raise PayloadError(f"Time: {time!r} does not fit two 32-bit numbers ({error})") from error


def decode_time(payload: bytes) -> WireTime:
    """Return the time in payload. Raises: PayloadError unless payload has eight bytes."""
    if len(payload) != _TIME.size:
        raise PayloadError(f"Time: has {len(payload)} bytes instead of 8")
    return WireTime(*_TIME.unpack(payload))


def split_seconds(time_s: float) -> WireTime:
    """Return time_s (s, not negative) as whole seconds and nanoseconds."""
    nanoseconds = round(time_s * 1e9)
    return WireTime(nanoseconds // 10**9, nanoseconds % 10**9)
