"""Packets of rosserial protocol 2: encoding, and finding them in a stream of bytes. Source: node_handle.h.

    ff fe | length (2, little endian) | ~(length bytes) | id (2, little endian) | payload | ~(id and payload)

`~(x)` is 255 minus the sum of the bytes x modulo 256.
"""

import functools
import struct
from typing import Callable, List, NamedTuple, Tuple, Union
from zlib import adler32

Bytes = Union[bytes, bytearray, memoryview]

SYNC = b"\xff\xfe"
"""Start of every packet; the second byte is the version of the protocol (0xff was version 1)."""

HEADER_LENGTH = 7
"""Bytes before the payload: sync 2, length 2, length checksum 1, topic id 2."""

OVERHEAD_LENGTH = 8
"""Bytes that a packet adds to its payload: the header and the checksum."""

_CHECKED_OFFSET = 5
"""Offset of the bytes that add up to 255 modulo 256, up to the end of the packet: id, payload and checksum."""

MAX_PAYLOAD_LENGTH = 0xFFFF
"""Limit of the 16-bit length field."""

DEFAULT_MAX_PAYLOAD_LENGTH = 4096
"""The robot's own buffers, in and out (INPUT_SIZE and OUTPUT_SIZE of the firmware's NodeHandle_)."""

# Ids with a meaning of their own (rosserial_msgs/TopicInfo, node_handle.h). Topics begin at 100.
ID_PUBLISHER = 0  # also: an empty packet with this id asks the robot for its topics
ID_SUBSCRIBER = 1
ID_SERVICE_SERVER_PUBLISHER = 2  # the answers of a service that the robot offers
ID_SERVICE_SERVER_SUBSCRIBER = 3  # its requests; 4 and 5 are services that a robot calls
ID_PARAMETER_REQUEST = 6
ID_LOG = 7
ID_TIME = 10
ID_TX_STOP = 11
FIRST_TOPIC_ID = 100

_HEADER = struct.Struct("<2sHBH")
_SYNC_NUMBER = int.from_bytes(SYNC, "little")
_read_header = struct.Struct("<HHBH").unpack_from  # with the sync as a number, which costs less
_COMPLEMENTS = bytes(range(255, -1, -1))
_LENGTH_CHECKSUMS = b"".join(_COMPLEMENTS[high:] + _COMPLEMENTS[:high] for high in range(256))
"""The checksum of each length, 255 minus the sum of its two bytes modulo 256; needed 200 times per robot and second."""

_CHECKED_PAYLOAD = slice(HEADER_LENGTH - _CHECKED_OFFSET, -1)
"""The payload among the bytes that are checked."""

_EXACT_ADLER_LENGTH = 256
"""adler32 & 0xffff is (1 + sum of the bytes) mod 65521: exact up to this length, and much faster than sum()."""


class RosserialError(ValueError):
    """Something cannot be encoded, or must not be sent to this peer: our mistake; what a peer does wrong is counted."""


class Packet(NamedTuple):
    """One packet whose length and checksums are right."""

    topic_id: int
    payload: bytes


def sum_bytes(data: Bytes) -> int:
    """Return the sum of all bytes of data modulo 256."""
    length = len(data)
    if length <= _EXACT_ADLER_LENGTH:
        return adler32(data) - 1 & 0xFF
    pieces = _make_splitter(length)(data)
    # The upper half of each adler32 adds nothing to the lowest byte.
    return sum(map(adler32, pieces)) - len(pieces) & 0xFF


@functools.lru_cache(maxsize=64)
def _make_splitter(length: int) -> Callable[[Bytes], Tuple[bytes, ...]]:
    """Return a function that cuts length bytes into pieces of which adler32 gives an exact sum."""
    whole, remainder = divmod(length, _EXACT_ADLER_LENGTH)
    return struct.Struct(("%ds" % _EXACT_ADLER_LENGTH) * whole + "%ds" % remainder).unpack


def encode_packet(topic_id: int, payload: Bytes) -> bytes:
    """Return the packet that carries payload under topic_id. Raises: RosserialError where they do not fit 16 bits."""
    if not 0 <= topic_id <= 0xFFFF:
        raise RosserialError(f"topic id {topic_id!r} is outside 0..65535")
    length = len(payload)
    if length > MAX_PAYLOAD_LENGTH:
        raise RosserialError("a payload of %d bytes does not fit a packet (at most 65535)" % length)
    header = _HEADER.pack(SYNC, length, _LENGTH_CHECKSUMS[length], topic_id)
    checksum = 255 - (topic_id + (topic_id >> 8) + sum_bytes(payload) & 0xFF)
    return b"".join((header, payload, bytes((checksum,))))


class PacketReader:
    """Cuts a stream of bytes into packets, whatever arrives, and counts packets, bad_packets and skipped_bytes.

    After a wrong checksum the search continues one byte behind the packet's start, so that a good packet inside is not
    lost. At most one packet of unread bytes is kept.
    """

    def __init__(self, max_payload_length: int = DEFAULT_MAX_PAYLOAD_LENGTH) -> None:
        """Accept payloads of at most max_payload_length bytes; longer packets count as bad."""
        self.packets = 0
        self.bad_packets = 0
        self.skipped_bytes = 0
        self._max_payload_length = max_payload_length
        self.remainder = b""  # the begun packet

    def receive_bytes(self, data: Bytes) -> List[Packet]:
        """Return the packets that data completes, in order. Never raises, whatever data holds."""
        return list(map(Packet._make, self.receive_pairs(data)))

    def receive_pairs(self, data: Bytes) -> List[Tuple[int, bytes]]:
        """As receive_bytes(), but as plain tuples, which saves a sixth of the reading."""
        buffer = self.remainder + data if self.remainder else bytes(data)
        end = len(buffer)
        last_start = end - HEADER_LENGTH
        max_length = self._max_payload_length
        position = 0
        found: List[Tuple[int, bytes]] = []
        # Every call costs here, 200 times per robot and second: short packets are checked without sum_bytes().
        while position <= last_start:
            sync, length, length_checksum, topic_id = _read_header(buffer, position)
            if sync != _SYNC_NUMBER:
                position = self._skip_to_sync(buffer, position)
                continue
            if length_checksum == _LENGTH_CHECKSUMS[length] and length <= max_length:
                packet_end = position + OVERHEAD_LENGTH + length
                if packet_end > end:
                    break
                checked = buffer[position + _CHECKED_OFFSET : packet_end]
                if len(checked) <= _EXACT_ADLER_LENGTH:
                    is_good = adler32(checked) & 0xFF == 0
                else:
                    is_good = sum_bytes(checked) == 0xFF
                if is_good:
                    found.append((topic_id, checked[_CHECKED_PAYLOAD]))
                    position = packet_end
                    continue
            self.bad_packets += 1
            self.skipped_bytes += 1
            position += 1
        self.remainder = buffer[self._skip_to_sync(buffer, position) :] if position < end else b""
        self.packets += len(found)
        return found

    def _skip_to_sync(self, buffer: bytes, position: int) -> int:
        """Return where the next packet may start; the end, or the last byte if that may be half a sync."""
        start = buffer.find(SYNC, position)
        if start < 0:
            start = len(buffer) - int(buffer.endswith(SYNC[:1], position))
        self.skipped_bytes += start - position
        return start
