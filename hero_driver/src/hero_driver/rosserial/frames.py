"""Bytes <-> Frame: the framing of rosserial protocol 2, and nothing else.

    ff fe | length (2, little endian) | ~(length bytes) | id (2, little endian) | payload | ~(id and payload)

`~(x)` is 255 minus the sum of the bytes x modulo 256. Source: ros_lib node_handle.h (publish() and the
states of spinOnce()).
"""

import functools
import struct
from typing import Callable, Dict, List, NamedTuple, Optional, Tuple, Union
from zlib import adler32

from .errors import FrameTooLongError, TopicIdError

Bytes = Union[bytes, bytearray, memoryview]

_Start = Tuple[int, int]  # length of a whole frame and its topic id, as its header says

SYNC = b"\xff\xfe"
"""Start of every frame; the second byte is the version of the protocol (0xff was version 1)."""

HEADER_LENGTH = 7
"""Bytes before the payload: sync 2, length 2, length checksum 1, topic id 2."""

OVERHEAD_LENGTH = 8
"""Bytes that a frame adds to its payload: the header and the checksum."""

CHECKED_OFFSET = 5
"""Where the bytes begin that add up to 255 modulo 256, to the end of the frame: id, payload and checksum."""

_PAYLOAD = slice(HEADER_LENGTH - CHECKED_OFFSET, -1)
"""Where the payload lies in the bytes that are checked."""

KNOWN_HEADERS_MAX = 64
"""Headers that a reader remembers; a stock robot sends about ten different ones, and log lines of any length."""

LONGEST_PAYLOAD_LENGTH = 0xFFFF
"""What the 16-bit length field can say."""

DEFAULT_MAX_PAYLOAD_LENGTH = 4096
"""The robot's own buffers, in and out (INPUT_SIZE and OUTPUT_SIZE of the firmware's NodeHandle_)."""

# Ids with a meaning of their own (rosserial_msgs/TopicInfo, node_handle.h). Topics begin at 100.
ID_PUBLISHER = 0  # also: an empty frame with this id asks the robot for its topics
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


class Frame(NamedTuple):
    """One frame that was read whole and whose checksums are right."""

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


def encode_frame(topic_id: int, payload: Bytes) -> bytes:
    """Return the frame that carries payload under topic_id.

    Raises: TopicIdError for an id outside 0..65535, FrameTooLongError for more than 65535 bytes of payload.
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
        raise FrameTooLongError("a payload of %d bytes does not fit a frame (at most 65535)" % length)
    length_checksum = 255 - ((length & 0xFF) + (length >> 8)) % 256
    return _HEADER.pack(SYNC, length, length_checksum, topic_id), (topic_id & 0xFF) + (topic_id >> 8)


class FrameReader:
    """Cuts a stream of bytes into frames, whatever arrives.

    Wrong bytes are counted and passed over, never raised: after a frame with a wrong checksum the search
    goes on one byte behind its start, so a good frame that it seemed to contain is not lost. The reader
    keeps at most one frame of unread bytes.

    Attributes:
        frames: good frames so far.
        bad_frames: frame starts whose length or payload checksum was wrong, or that were too long.
        skipped_bytes: bytes that belonged to no good frame.
    """

    def __init__(self, max_payload_length: int = DEFAULT_MAX_PAYLOAD_LENGTH) -> None:
        """Accept payloads of at most max_payload_length bytes; longer frames count as bad."""
        self.max_payload_length = max_payload_length
        self.frames = 0
        self.bad_frames = 0
        self.skipped_bytes = 0
        self._rest = b""
        self._known: Dict[bytes, _Start] = {}

    @property
    def buffered_length(self) -> int:
        """Bytes of a frame that is not complete yet."""
        return len(self._rest)

    def receive_bytes(self, data: Bytes) -> List[Frame]:
        """Return the frames that data completes, in order. Never raises, whatever data holds."""
        return [Frame(*pair) for pair in self.receive_pairs(data)]

    def receive_pairs(self, data: Bytes) -> List[Tuple[int, bytes]]:
        """As receive_bytes(), but plain pairs of topic id and payload, which cost a fifth of a Frame."""
        buffer = self._rest + bytes(data) if self._rest else bytes(data)
        end = len(buffer)
        frames: List[Tuple[int, bytes]] = []
        position = 0
        while position < end:
            # A robot sends the same few headers all the time; one that was right once is right.
            start = self._known.get(buffer[position : position + HEADER_LENGTH])
            if start is None:
                position, start = self._find_start(buffer, position, end)
                if start is None:
                    break
            frame_length, topic_id = start
            frame_end = position + frame_length
            if frame_end > end:
                break
            checked = buffer[position + CHECKED_OFFSET : frame_end]
            if frame_length <= _EXACT_ADLER_LENGTH:
                # One more than the sum, of which the last byte is 255 where everything is right.
                is_wrong = adler32(checked) & 0xFF
            else:
                is_wrong = sum_bytes(checked) != 0xFF
            if is_wrong:
                position = self._skip_bad_start(position)
                continue
            frames.append((topic_id, checked[_PAYLOAD]))
            position = frame_end
        self._rest = buffer[position:]
        self.frames += len(frames)
        return frames

    def _find_start(self, buffer: bytes, position: int, end: int) -> Tuple[int, Optional[_Start]]:
        """Return where the next right header begins, and what it says: None where it is not complete yet."""
        while True:
            if not buffer.startswith(SYNC, position):
                start = self._find_sync(buffer, position)
                self.skipped_bytes += start - position
                position = start
            if end - position < HEADER_LENGTH:
                if not self._has_bad_length(buffer, position, end):
                    return position, None
            else:
                length, length_checksum, topic_id = _FIELDS.unpack_from(buffer, position + len(SYNC))
                if self._is_length(length, length_checksum):
                    if len(self._known) >= KNOWN_HEADERS_MAX:
                        self._known.clear()
                    known = (OVERHEAD_LENGTH + length, topic_id)
                    self._known[buffer[position : position + HEADER_LENGTH]] = known
                    return position, known
            position = self._skip_bad_start(position)

    def _is_length(self, length: int, checksum: int) -> bool:
        return (length + (length >> 8) + checksum) & 0xFF == 0xFF and length <= self.max_payload_length

    @staticmethod
    def _find_sync(buffer: bytes, position: int) -> int:
        """Return where the next frame may start; the end, or the last byte if that may be a half sync."""
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
        self.bad_frames += 1
        self.skipped_bytes += 1
        return position + 1


def decode_frame(data: Bytes) -> Optional[Frame]:
    """Return the one frame that data holds from first to last byte, or None if it holds anything else."""
    frames = FrameReader(LONGEST_PAYLOAD_LENGTH).receive_bytes(data)
    if len(frames) == 1 and len(data) == OVERHEAD_LENGTH + len(frames[0].payload):
        return frames[0]
    return None
