"""ROS messages as bytes: md5 sums, layouts, encoders, and messages in a TCPROS stream, each behind its length. Pure."""

import math
import struct
from typing import Iterable, Iterator, Sequence, Tuple, Union

Numbers = Sequence[float]

Stamp = Tuple[int, int]
"""Seconds and nanoseconds."""

MD5SUMS = {
    "nav_msgs/Odometry": "cd5e73d190d741a2f92e81eda573aca7",
    "hero_msgs/Encoder": "b5586cdbae9b740afc6a1f403a2d7dde",
    "tf2_msgs/TFMessage": "94810edda583a504dfda3829e70d7eec",
    "sensor_msgs/LaserScan": "90c7ef2dc6895d81024acba2ac42f369",
    "sensor_msgs/Imu": "6a62c6daae103f4ff57a132d6f95cec2",
    "geometry_msgs/Twist": "9f195f881246fdfa2798d1d3eebca84a",
    "hero_msgs/Motor": "44d4249d207ce6a89de3d72080e4d0b5",
    "std_msgs/Float32": "73fcbf46b49191e672908e50842a83d4",
    "sensor_msgs/Range": "c005c34273dc426c67a020a87bc24148",
}
"""By type: the layouts that are read or written as bytes. Another md5 is another layout."""

PLUS_ENCODER_MD5 = "ec5c02e99365233af779a0f9f54cb0df"
"""HeRo+'s hero_msgs/Encoder, which has |left_ticks - right_ticks| before timestep, too."""

LENGTH = struct.Struct("<I")
"""In front of texts, lists and, in a TCPROS stream, messages."""

HEADER = struct.Struct("<4I")
"""std_msgs/Header before its text: seq, secs, nsecs, length of frame_id."""

POSE_FORM = struct.Struct("<7d")
"""geometry_msgs/Pose or Transform: x, y, z and a quaternion x, y, z, w."""

TWIST_FORM = struct.Struct("<6d")
"""geometry_msgs/Twist: linear x, y, z and angular x, y, z."""

COVARIANCE_FORM = struct.Struct("<36d")
NO_COVARIANCE = bytes(COVARIANCE_FORM.size)

ENCODER_FORM = struct.Struct("<11d")
"""hero_msgs/Encoder behind its header; left and right ticks come first."""

SCAN_FORM = "<7fI%dfI%df"
"""sensor_msgs/LaserScan behind its header: angles, times and limits; ranges and intensities, each behind its number."""


def encode_text(text: str) -> bytes:
    """Return a string field: its length in bytes, then the text in UTF-8."""
    data = text.encode()
    return LENGTH.pack(len(data)) + data


def encode_header(seq: int, frame_id: str, stamp: Stamp = (0, 0)) -> bytes:
    """Return a std_msgs/Header; seq counts modulo 2**32, -1 too."""
    data = frame_id.encode()
    return HEADER.pack(seq & 0xFFFFFFFF, *stamp, len(data)) + data


def encode_pose(x_m: float, y_m: float, yaw_rad: float, z_m: float = 0.0) -> bytes:
    """Return a geometry_msgs/Pose or Transform that is turned about z only."""
    half_rad = yaw_rad / 2.0
    return POSE_FORM.pack(x_m, y_m, z_m, 0.0, 0.0, math.sin(half_rad), math.cos(half_rad))


def encode_twist(linear_m_s: float, angular_rad_s: float) -> bytes:
    """Return a geometry_msgs/Twist in the plane."""
    return TWIST_FORM.pack(linear_m_s, 0.0, 0.0, 0.0, 0.0, angular_rad_s)


def encode_odometry(
    frame_id: str, child_frame_id: str, stamp: Stamp, pose: Numbers, velocity: Numbers, seq: int = 0
) -> bytes:
    """Return a nav_msgs/Odometry without covariances; pose: arguments of encode_pose(); velocity: m/s, rad/s."""
    head = encode_header(seq, frame_id, stamp) + encode_text(child_frame_id)
    return b"".join((head, encode_pose(*pose), NO_COVARIANCE, encode_twist(*velocity), NO_COVARIANCE))


def encode_transforms(stamp: Stamp, transforms: Iterable[Tuple[str, str, Numbers]]) -> bytes:
    """Return a tf2_msgs/TFMessage; each transform: parent, child, arguments of encode_pose() for child in parent."""
    return encode_list([_encode_transform(stamp, *transform) for transform in transforms])


def _encode_transform(stamp: Stamp, parent: str, child: str, pose: Numbers) -> bytes:
    return encode_header(0, parent, stamp) + encode_text(child) + encode_pose(*pose)


def encode_list(items: Sequence[bytes]) -> bytes:
    """Return a list field of encoded items, and so a message that is one list: tf2_msgs/TFMessage, MarkerArray."""
    return LENGTH.pack(len(items)) + b"".join(items)


def encode_scan(header: bytes, settings: Numbers, ranges_m: Numbers, intensities: Numbers = ()) -> bytes:
    """Return a sensor_msgs/LaserScan.

    settings: angle_min, angle_max, angle_increment (rad), time_increment, scan_time (s), range_min, range_max (m).
    """
    beams, count = len(ranges_m), len(intensities)
    return header + struct.pack(SCAN_FORM % (beams, count), *settings, beams, *ranges_m, count, *intensities)


def encode_turn_scan(
    header: bytes, scan_time_s: float, limits_m: Tuple[float, float], ranges_m: Numbers, intensities: Numbers = ()
) -> bytes:
    """Return a sensor_msgs/LaserScan of a whole turn, rear first and counter-clockwise; limits_m: least, greatest."""
    step_rad = 2.0 * math.pi / len(ranges_m)
    settings = (-math.pi, math.pi - step_rad, step_rad, 0.0, scan_time_s, *limits_m)
    return encode_scan(header, settings, ranges_m, intensities)


class TooLongError(ValueError):
    """A length that no message has: the other end does not speak TCPROS."""


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
