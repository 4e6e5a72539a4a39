"""Encodes and decodes the payloads of rosserial's own packets, little endian, in the order of their definitions."""

import struct
from typing import NamedTuple

from hero_node import LENGTH, encode_text

from .packets import Bytes, RosserialError

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


class _Cursor:
    """Reads fields one after another; every short or odd field is a PayloadError that names it."""

    def __init__(self, data: Bytes, what: str) -> None:
        self._data = bytes(data)
        self._what = what
        self._position = 0

    def read_bytes(self, length: int, field: str) -> bytes:
        start, end = self._position, self._position + length
        if end > len(self._data):
            raise PayloadError(
                "%s: field %s needs %d bytes, %d are left" % (self._what, field, length, len(self._data) - start)
            )
        self._position = end
        return self._data[start:end]

    def read_number(self, layout: struct.Struct, field: str) -> int:
        value: int = layout.unpack(self.read_bytes(layout.size, field))[0]
        return value

    def read_text(self, field: str) -> str:
        # Peers are not trusted to send UTF-8: what cannot be read stays visible as an escape.
        return self.read_bytes(self.read_number(LENGTH, field), field).decode("utf-8", "backslashreplace")

    def finish(self) -> None:
        left = len(self._data) - self._position
        if left:
            raise PayloadError("%s: %d bytes follow its last field" % (self._what, left))


def encode_topic_info(info: TopicInfo) -> bytes:
    """Return the payload that declares info (packet ids 0..5 say in which direction)."""
    texts = map(encode_text, (info.name, info.message_type, info.md5sum))
    return b"".join((_UINT16.pack(info.topic_id), *texts, _INT32.pack(info.buffer_length)))


def decode_topic_info(payload: Bytes) -> TopicInfo:
    """Return what payload declares. Raises: PayloadError if it is cut short or longer than its fields."""
    cursor = _Cursor(payload, "TopicInfo")
    info = TopicInfo(
        cursor.read_number(_UINT16, "topic_id"),
        cursor.read_text("topic_name"),
        cursor.read_text("message_type"),
        cursor.read_text("md5sum"),
        cursor.read_number(_INT32, "buffer_size"),
    )
    cursor.finish()
    return info


def encode_log(log: Log) -> bytes:
    """Return the payload of one log line."""
    return bytes((log.level,)) + encode_text(log.text)


def decode_log(payload: Bytes) -> Log:
    """Return the log line in payload, color codes and all. Raises: PayloadError as decode_topic_info()."""
    cursor = _Cursor(payload, "Log")
    level = cursor.read_bytes(1, "level")[0]
    log = Log(level, cursor.read_text("msg"))
    cursor.finish()
    return log


def encode_time(time: WireTime) -> bytes:
    """Return the eight bytes of time. Raises: PayloadError if a part does not fit 32 bits."""
    try:
        return _TIME.pack(time.secs, time.nsecs)
    except struct.error as error:
        raise PayloadError(f"Time: {time!r} does not fit two 32-bit numbers ({error})") from error


def decode_time(payload: Bytes) -> WireTime:
    """Return the time in payload. Raises: PayloadError unless payload has eight bytes."""
    if len(payload) != _TIME.size:
        raise PayloadError(f"Time: has {len(payload)} bytes instead of 8")
    return WireTime(*_TIME.unpack(payload))


def split_seconds(time_s: float) -> WireTime:
    """Return time_s (s, not negative) as whole seconds and nanoseconds."""
    nanoseconds = round(time_s * 1e9)
    return WireTime(nanoseconds // 10**9, nanoseconds % 10**9)
