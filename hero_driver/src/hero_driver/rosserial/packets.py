"""Bytes <-> Packet: the framing of rosserial protocol 2, and nothing else.

    ff fe | length (2, little endian) | ~(length bytes) | id (2, little endian) | payload | ~(id and payload)

`~(x)` is 255 minus the sum of the bytes x modulo 256. Source: ros_lib node_handle.h (publish() and the
states of spinOnce()).
"""

import functools
import operator
import struct
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple, Union
from zlib import adler32

from .errors import PacketTooLongError, TopicIdError

Bytes = Union[bytes, bytearray, memoryview]

Columns = Tuple[Sequence[int], Sequence[bytes]]  # topic ids and payloads of packets, in order
_Shape = Tuple[Tuple[int, int], ...]  # topic ids and lengths of payloads of packets in a row

SYNC = b"\xff\xfe"
"""Start of every packet; the second byte is the version of the protocol (0xff was version 1)."""

HEADER_LENGTH = 7
"""Bytes before the payload: sync 2, length 2, length checksum 1, topic id 2."""

OVERHEAD_LENGTH = 8
"""Bytes that a packet adds to its payload: the header and the checksum."""

CHECKED_OFFSET = 5
"""Where the bytes begin that add up to 255 modulo 256, to the end of the packet: id, payload and checksum."""

_PAYLOAD = slice(HEADER_LENGTH - CHECKED_OFFSET, -1)
"""Where the payload lies in the bytes that are checked."""

PATTERNS_MAX = 16
"""Patterns of packets that a reader remembers; a stock robot's bursts have about six."""

PATTERN_PACKETS_MAX = 16
"""Packets of a pattern; a burst has seven, and at times laser, IMU and log."""

LONGEST_PAYLOAD_LENGTH = 0xFFFF
"""What the 16-bit length field can say."""

DEFAULT_MAX_PAYLOAD_LENGTH = 4096
"""The robot's own buffers, in and out (INPUT_SIZE and OUTPUT_SIZE of the firmware's NodeHandle_)."""

# Ids with a meaning of their own (rosserial_msgs/TopicInfo, node_handle.h). Topics begin at 100.
ID_PUBLISHER = 0  # also: an empty packet with this id asks the robot for its topics
ID_SUBSCRIBER = 1
ID_SERVICE_SERVER_PUBLISHER = 2  # the answers of a service that the robot offers
ID_SERVICE_SERVER_SUBSCRIBER = 3  # its requests
ID_SERVICE_CLIENT_PUBLISHER = 4  # the requests of a service that the robot calls
ID_SERVICE_CLIENT_SUBSCRIBER = 5  # its answers
ID_PARAMETER_REQUEST = 6
ID_LOG = 7
ID_TIME = 10
ID_TX_STOP = 11
FIRST_TOPIC_ID = 100

_HEADER = struct.Struct("<2sHBH")
_FIELDS = struct.Struct("<HBH")  # the header behind the sync
_LENGTH = struct.Struct("<H")

# adler32 & 0xffff is (1 + sum of the bytes) mod 65521. Up to 256 bytes the sum is at most 65280, so
# nothing wraps and the sum is exact, at a fraction of the cost of sum() over a bytes object.
_EXACT_ADLER_LENGTH = 256


class Packet(NamedTuple):
    """One packet that was read whole and whose checksums are right."""

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
    """Return what cuts length bytes into pieces of which adler32 gives an exact sum."""
    whole, rest = divmod(length, _EXACT_ADLER_LENGTH)
    return struct.Struct(("%ds" % _EXACT_ADLER_LENGTH) * whole + "%ds" % rest).unpack


def encode_packet(topic_id: int, payload: Bytes) -> bytes:
    """Return the packet that carries payload under topic_id.

    Raises: TopicIdError for an id outside 0..65535, PacketTooLongError for more than 65535 bytes of payload.
    """
    header, id_sum = _encode_header(topic_id, len(payload))
    checksum = 255 - (id_sum + sum_bytes(payload) & 0xFF)
    return b"".join((header, payload, bytes((checksum,))))


@functools.lru_cache(maxsize=256)
def _encode_header(topic_id: int, length: int) -> Tuple[bytes, int]:
    """Return what comes before a payload of length bytes, and the sum of the bytes of topic_id."""
    if not 0 <= topic_id <= 0xFFFF:
        raise TopicIdError("topic id %r is outside 0..65535" % (topic_id,))
    if length > LONGEST_PAYLOAD_LENGTH:
        raise PacketTooLongError("a payload of %d bytes does not fit a packet (at most 65535)" % length)
    length_checksum = 255 - ((length & 0xFF) + (length >> 8)) % 256
    return _HEADER.pack(SYNC, length, length_checksum, topic_id), (topic_id & 0xFF) + (topic_id >> 8)


class _Pattern:
    """Packets in a row that have come together before: cut and checked by a few calls, not one by one.

    Attributes:
        end: offset of the first byte behind them.
    """

    def __init__(self, shape: _Shape) -> None:
        self._ids = tuple(topic_id for topic_id, _ in shape)
        self._headers = tuple(_encode_header(topic_id, length)[0] for topic_id, length in shape)
        self._cut = struct.Struct(
            "<" + "".join("%ds%dsx" % (HEADER_LENGTH, length) for _, length in shape)
        ).unpack_from
        self._long: List[slice] = []  # what adler32 cannot check by itself
        short = "<"
        self.end = 0
        for _, length in shape:
            start, self.end = self.end + CHECKED_OFFSET, self.end + OVERHEAD_LENGTH + length
            checked_length = self.end - start
            if checked_length <= _EXACT_ADLER_LENGTH:
                short += "%dx%ds" % (CHECKED_OFFSET, checked_length)
            else:
                short += "%dx" % (CHECKED_OFFSET + checked_length)
                self._long.append(slice(start, self.end))
        self._cut_short = struct.Struct(short).unpack_from

    def read(self, buffer: bytes) -> Optional[Columns]:
        """Return the packets at the start of buffer, which is long enough; None where one is another or wrong."""
        fields = self._cut(buffer)
        if fields[::2] != self._headers:
            return None
        # Each is one more than a sum, of which the last byte is 255 where everything is right.
        if functools.reduce(operator.or_, map(adler32, self._cut_short(buffer)), 0) & 0xFF:
            return None
        for checked in self._long:
            if sum_bytes(buffer[checked]) != 0xFF:
                return None
        return self._ids, fields[1::2]


_make_pattern = functools.lru_cache(maxsize=256)(_Pattern)  # robots have patterns in common


class PacketReader:
    """Cuts a stream of bytes into packets, whatever arrives.

    Wrong bytes are counted and passed over, never raised: after a packet with a wrong checksum the search
    goes on one byte behind its start, so a good packet that it seemed to contain is not lost. The reader
    keeps at most one packet of unread bytes.

    Attributes:
        packets: good packets so far.
        bad_packets: packet starts whose length or payload checksum was wrong, or that were too long.
        skipped_bytes: bytes that belonged to no good packet.
    """

    def __init__(self, max_payload_length: int = DEFAULT_MAX_PAYLOAD_LENGTH) -> None:
        """Accept payloads of at most max_payload_length bytes; longer packets count as bad."""
        self.max_payload_length = max_payload_length
        self.packets = 0
        self.bad_packets = 0
        self.skipped_bytes = 0
        self._rest = b""
        # By the length of the bytes at hand: what they held last, and if twice the same, the pattern of it.
        self._shapes: Dict[int, _Shape] = {}
        self._patterns: Dict[int, _Pattern] = {}

    @property
    def buffered_length(self) -> int:
        """Bytes of a packet that is not complete yet."""
        return len(self._rest)

    def receive_bytes(self, data: Bytes) -> List[Packet]:
        """Return the packets that data completes, in order. Never raises, whatever data holds."""
        return list(map(Packet, *self.receive_columns(data)))

    def receive_columns(self, data: Bytes) -> Columns:
        """As receive_bytes(), but topic ids and payloads apart, which costs less than a Packet for each."""
        buffer = self._rest + bytes(data) if self._rest else bytes(data)
        end = len(buffer)
        # A robot sends the same few packets all the time.
        pattern = self._patterns.get(end)
        columns = None if pattern is None else pattern.read(buffer)
        if pattern is None or columns is None:
            skipped_bytes = self.skipped_bytes
            columns = self._read_one_by_one(buffer, 0)
            if columns[0] and self.skipped_bytes == skipped_bytes:
                self._learn_pattern(end, columns)
        elif pattern.end < end:
            ids, payloads = self._read_one_by_one(buffer, pattern.end)
            columns = (*columns[0], *ids), (*columns[1], *payloads)
        else:
            self._rest = b""
        self.packets += len(columns[0])
        return columns

    def _read_one_by_one(self, buffer: bytes, position: int) -> Columns:
        """Return the packets from position on, and keep what is not complete yet."""
        end = len(buffer)
        ids: List[int] = []
        payloads: List[bytes] = []
        while position < end:
            position, packet_length, topic_id = self._find_start(buffer, position, end)
            packet_end = position + packet_length
            if packet_length == 0 or packet_end > end:
                break
            checked = buffer[position + CHECKED_OFFSET : packet_end]
            if sum_bytes(checked) != 0xFF:
                position = self._skip_bad_start(position)
                continue
            ids.append(topic_id)
            payloads.append(checked[_PAYLOAD])
            position = packet_end
        self._rest = buffer[position:]
        return ids, payloads

    def _learn_pattern(self, length: int, columns: Columns) -> None:
        """Note that length bytes began with these packets, nothing between them."""
        ids, payloads = columns
        if len(ids) > PATTERN_PACKETS_MAX:
            return
        shape = tuple(zip(ids, map(len, payloads)))
        if self._shapes.get(length) == shape:
            if len(self._patterns) >= PATTERNS_MAX:
                self._patterns.clear()
            self._patterns[length] = _make_pattern(shape)
        else:
            if len(self._shapes) >= PATTERNS_MAX:
                self._shapes.clear()
            self._shapes[length] = shape

    def _find_start(self, buffer: bytes, position: int, end: int) -> Tuple[int, int, int]:
        """Return where the next right header begins, how long its packet is, 0 if that is not there yet, and its id."""
        while True:
            if not buffer.startswith(SYNC, position):
                start = self._find_sync(buffer, position)
                self.skipped_bytes += start - position
                position = start
            if end - position < HEADER_LENGTH:
                if not self._has_bad_length(buffer, position, end):
                    return position, 0, 0
            else:
                length, length_checksum, topic_id = _FIELDS.unpack_from(buffer, position + len(SYNC))
                if self._is_length(length, length_checksum):
                    return position, OVERHEAD_LENGTH + length, topic_id
            position = self._skip_bad_start(position)

    def _is_length(self, length: int, checksum: int) -> bool:
        return (length + (length >> 8) + checksum) & 0xFF == 0xFF and length <= self.max_payload_length

    @staticmethod
    def _find_sync(buffer: bytes, position: int) -> int:
        """Return where the next packet may start; the end, or the last byte if that may be a half sync."""
        start = buffer.find(SYNC, position)
        if start >= 0:
            return start
        end = len(buffer)
        return end - 1 if end > position and buffer[end - 1] == SYNC[0] else end

    def _has_bad_length(self, buffer: bytes, position: int, end: int) -> bool:
        """Return whether an incomplete header already shows that it is none, so that nothing waits for it."""
        if end - position < CHECKED_OFFSET:
            return False
        return not self._is_length(_LENGTH.unpack_from(buffer, position + len(SYNC))[0], buffer[position + 4])

    def _skip_bad_start(self, position: int) -> int:
        self.bad_packets += 1
        self.skipped_bytes += 1
        return position + 1


def decode_packet(data: Bytes) -> Optional[Packet]:
    """Return the one packet that data holds from first to last byte, or None if it holds anything else."""
    packets = PacketReader(LONGEST_PAYLOAD_LENGTH).receive_bytes(data)
    if len(packets) == 1 and len(data) == OVERHEAD_LENGTH + len(packets[0].payload):
        return packets[0]
    return None
