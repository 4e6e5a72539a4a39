"""ROS messages as bytes: fields of many types, and messages in a TCPROS stream, each behind its length. Pure."""

import math
import struct
from typing import Iterator, Tuple, Union

LENGTH = struct.Struct("<I")
"""In front of texts, lists and messages."""

HEADER = struct.Struct("<4I")
"""std_msgs/Header before its text: seq, secs, nsecs, length of frame_id."""

POSE_FORM = struct.Struct("<7d")
TWIST_FORM = struct.Struct("<6d")


class TooLongError(ValueError):
    """A length that no message has: the other end does not speak TCPROS."""


def encode_text(text: str) -> bytes:
    """Return a string field."""
    data = text.encode()
    return LENGTH.pack(len(data)) + data


def encode_header(seq: int, frame_id: str, stamp: Tuple[int, int] = (0, 0)) -> bytes:
    """Return a std_msgs/Header; stamp: s, ns."""
    data = frame_id.encode()
    return HEADER.pack(seq & 0xFFFFFFFF, *stamp, len(data)) + data


def encode_pose(x_m: float, y_m: float, yaw_rad: float, z_m: float = 0.0) -> bytes:
    """Return a geometry_msgs/Pose or Transform that is turned about z only."""
    half_rad = yaw_rad / 2.0
    return POSE_FORM.pack(x_m, y_m, z_m, 0.0, 0.0, math.sin(half_rad), math.cos(half_rad))


def find_messages(data: Union[bytes, bytearray], length_max: int) -> Iterator[Tuple[int, int]]:
    """Yield the start and end of each complete message. Raises: TooLongError behind the messages before it."""
    end, data_length, prefix_length = 0, len(data), LENGTH.size
    while data_length - end >= prefix_length:
        length: int = LENGTH.unpack_from(data, end)[0]
        if length > length_max:
            raise TooLongError("a message of %d bytes; at most %d are accepted" % (length, length_max))
        start = end + prefix_length
        end = start + length
        if end > data_length:
            return
        yield start, end
