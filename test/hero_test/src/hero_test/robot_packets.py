"""Packets of rosserial as a stock robot sends and reads them: not by the driver's code, whose mistakes would not show.

    ff fe | length (2, little endian) | ~(length bytes) | id (2, little endian) | payload | ~(id and payload)

`~(x)` is 255 minus the sum of the bytes x modulo 256. Source: ros_lib node_handle.h; declarations and log lines:
rosserial_msgs/TopicInfo and Log.
"""

import struct
from typing import List, NamedTuple

PUBLISHER, SUBSCRIBER = 0, 1  # what declares a topic; an empty PUBLISHER asks for all topics
SERVICE_ANSWERS, SERVICE_REQUESTS = 2, 3
LOG, TIME = 7, 10
LOG_INFO = 1

SYNC = b"\xff\xfe"
CHECKED_OFFSET, PAYLOAD_OFFSET = 5, 7


class Packet(NamedTuple):
    """One packet whose checksums are right."""

    topic_id: int
    payload: bytes


def encode_packet(topic_id: int, payload: bytes) -> bytes:
    """Return the bytes of a packet."""
    length, checked = struct.pack("<H", len(payload)), struct.pack("<H", topic_id) + payload
    return SYNC + length + _complement(length) + checked + _complement(checked)


def _complement(data: bytes) -> bytes:
    return bytes([255 - sum(data) % 256])


def _encode_text(text: str) -> bytes:
    return struct.pack("<I", len(text.encode())) + text.encode()


def encode_declaration(topic_id: int, name: str, message_type: str, md5sum: str, buffer_length: int) -> bytes:
    """Return the payload that declares a topic."""
    texts = b"".join(map(_encode_text, (name, message_type, md5sum)))
    return struct.pack("<H", topic_id) + texts + struct.pack("<i", buffer_length)


def encode_log(level: int, text: str) -> bytes:
    """Return the payload of a log line."""
    return bytes([level]) + _encode_text(text)


class PacketReader:
    """Cuts bytes into packets, and looks for the next one behind a wrong byte."""

    def __init__(self) -> None:
        self._unread = bytearray()

    def receive_bytes(self, data: bytes) -> List[Packet]:
        """Return the packets that these bytes complete."""
        self._unread += data
        found, unread = [], self._unread
        while len(unread) > PAYLOAD_OFFSET:
            end = PAYLOAD_OFFSET + int.from_bytes(unread[2:4], "little") + 1
            if unread[:2] != SYNC or sum(unread[2:5]) % 256 != 255:
                del unread[0]
            elif len(unread) < end:
                break
            elif sum(unread[CHECKED_OFFSET:end]) % 256 != 255:
                del unread[0]
            else:
                topic_id = int.from_bytes(unread[CHECKED_OFFSET:PAYLOAD_OFFSET], "little")
                found.append(Packet(topic_id, bytes(unread[PAYLOAD_OFFSET : end - 1])))
                del unread[:end]
        return found
