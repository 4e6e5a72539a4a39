"""The messages that the driver reads and patches, by fixed offsets. Pure."""

import math
import struct
from typing import Callable, Dict, List, Optional, Sequence, Tuple

from hero_node.robot_constants import (
    BODY_RADIUS_M,
    DISTANCE_CONE_RAD,
    MAX_DISTANCE_M,
    MAX_RIM_RANGE_M,
    MIN_DISTANCE_M,
    MIN_RIM_RANGE_M,
    STOCK_BEAMS,
)
from hero_node.ros_messages import (
    COVARIANCE_FORM,
    ENCODER_FORM,
    HEADER,
    LENGTH,
    PLUS_ENCODER_MD5,
    POSE_FORM,
    SCAN_FORM,
    TWIST_FORM,
    encode_header,
    encode_turn_scan,
)

from .stamps import NS_PER_S
from .tick_odometry import MAX_WHEEL_SPEED_M_S

_SEQ_AND_STAMP = struct.Struct("<III")
_ENCODER_TICKS = struct.Struct("<2d")

TRANSFORM_TAIL_LENGTH = POSE_FORM.size  # translation and rotation
ODOMETRY_TAIL_LENGTH = POSE_FORM.size + COVARIANCE_FORM.size + TWIST_FORM.size + COVARIANCE_FORM.size

CLAMP_TOLERANCE_M = 1e-4

MAX_POSITION_M = 1e4
"""Farther than a robot drives in half a day."""

MAX_TURN_RAD_S = 100.0
"""Three times what two wheels at MAX_WHEEL_SPEED_M_S could do to a robot."""


def read_stamp_ns(payload: bytes) -> Optional[int]:
    """Return the stamp of a payload that begins with a header, or None if it is too short for one."""
    if len(payload) < HEADER.size:
        return None
    _, secs, nsecs, _ = HEADER.unpack_from(payload)
    stamp_ns: int = secs * NS_PER_S + nsecs
    return stamp_ns


def restamp(payload: bytes, seq: int, stamp_ns: int) -> bytes:
    """Return payload, which begins with a header, with another sequence number and stamp."""
    secs, nsecs = divmod(stamp_ns, NS_PER_S)
    return _SEQ_AND_STAMP.pack(seq & 0xFFFFFFFF, secs, nsecs) + payload[_SEQ_AND_STAMP.size :]


def read_encoder(payload: bytes) -> Optional[Tuple[int, float, float]]:
    """Return (stamp_ns, left_ticks, right_ticks) of a hero_msgs/Encoder, or None if payload is not one."""
    end = len(payload) - ENCODER_FORM.size
    if end < HEADER.size:
        return None
    _, secs, nsecs, length = HEADER.unpack_from(payload)
    if HEADER.size + length != end:
        return None
    left, right = _ENCODER_TICKS.unpack_from(payload, end)
    return secs * NS_PER_S + nsecs, left, right


_BEHIND_DISTANCES = -5 * 8  # timestep and the four speeds


def drop_tick_difference(payload: bytes) -> bytes:
    """Return the hero_msgs/Encoder in that of HeRo+, which has |left_ticks - right_ticks| before timestep."""
    return payload[: _BEHIND_DISTANCES - 8] + payload[_BEHIND_DISTANCES:]


CONVERSIONS: Dict[Tuple[str, str], Callable[[bytes], bytes]] = {
    ("hero_msgs/Encoder", PLUS_ENCODER_MD5): drop_tick_difference
}
"""By type and md5 of a layout that some robots have: what makes the known layout of it."""

_ODOMETRY_FRAMES = slice(_SEQ_AND_STAMP.size, -ODOMETRY_TAIL_LENGTH)
_ODOMETRY_POSE = slice(-ODOMETRY_TAIL_LENGTH, POSE_FORM.size - ODOMETRY_TAIL_LENGTH)
_ODOMETRY_TWIST = slice(-TWIST_FORM.size - COVARIANCE_FORM.size, -COVARIANCE_FORM.size)


def read_odometry_velocity(payload: bytes) -> Optional[Tuple[float, float]]:
    """Return the linear (m/s) and angular (rad/s) speed in a nav_msgs/Odometry, or None if payload is too short."""
    if len(payload) < ODOMETRY_TAIL_LENGTH:
        return None
    components = TWIST_FORM.unpack(payload[_ODOMETRY_TWIST])
    return math.hypot(components[0], math.hypot(*components[1:3])), math.hypot(
        components[5], math.hypot(*components[3:5])
    )


class OdometryWriter:
    """Writes nav_msgs/Odometry of one robot; covariances and frames are put in once."""

    def __init__(self, pose_covariance: Sequence[float], twist_covariance: Sequence[float]) -> None:
        """Take the diagonals of both covariances (x, y, z, roll, pitch, yaw), in m^2 and rad^2, per s^2."""
        self._pose_covariance = COVARIANCE_FORM.pack(*_make_diagonal(pose_covariance))
        self._twist_covariance = COVARIANCE_FORM.pack(*_make_diagonal(twist_covariance))
        self._frames: Optional[bytes] = None

    def rewrite(
        self, payload: bytes, seq: int, stamp_ns: int, estimate: Optional[Tuple[bytes, float, float]]
    ) -> Optional[bytes]:
        """Return the robot's message with stamp and covariances; None if it is not one, or its numbers cannot be true.

        estimate: replaces pose, as encode_pose() gives it, and velocities ahead (m/s) and around z (rad/s).
        """
        # A robot's frames never change, so they are looked at once.
        frames = payload[_ODOMETRY_FRAMES]
        if frames != self._frames:
            if not _holds_two_texts(frames):
                return None
            self._frames = frames
        if estimate is None:
            pose, twist = payload[_ODOMETRY_POSE], payload[_ODOMETRY_TWIST]
            if not _is_possible(POSE_FORM.unpack(pose), TWIST_FORM.unpack(twist)):
                return None
        else:
            pose, linear_m_s, angular_rad_s = estimate
            twist = TWIST_FORM.pack(linear_m_s, 0.0, 0.0, 0.0, 0.0, angular_rad_s)
        secs, nsecs = divmod(stamp_ns, NS_PER_S)
        head = _SEQ_AND_STAMP.pack(seq & 0xFFFFFFFF, secs, nsecs)
        return b"".join((head, frames, pose, self._pose_covariance, twist, self._twist_covariance))


def _is_possible(pose: Sequence[float], twist: Sequence[float]) -> bool:
    """Return whether the numbers of an odometry can be those of a robot; comparisons with NaN fail."""
    return (
        -MAX_POSITION_M <= pose[0] <= MAX_POSITION_M
        and -MAX_POSITION_M <= pose[1] <= MAX_POSITION_M
        and -MAX_WHEEL_SPEED_M_S <= twist[0] <= MAX_WHEEL_SPEED_M_S
        and -MAX_TURN_RAD_S <= twist[5] <= MAX_TURN_RAD_S
        # A sum is finite only if each part is.
        and math.isfinite(sum(pose) + sum(twist))
    )


def find_transform_fault(tail: bytes) -> str:
    """Return translation and rotation of a transform that cannot be a robot's, for users; empty if they can."""
    x_m, y_m, z_m, x, y, z, w = POSE_FORM.unpack(tail)
    if (  # in one go, as it runs 147 times a second for each robot; comparisons with NaN fail
        -MAX_POSITION_M <= x_m <= MAX_POSITION_M
        and -MAX_POSITION_M <= y_m <= MAX_POSITION_M
        and -MAX_POSITION_M <= z_m <= MAX_POSITION_M
        and 0.5 < x * x + y * y + z * z + w * w < 2.0
    ):
        return ""
    return "x %.4g m, y %.4g m, z %.4g m, rotation %.4g %.4g %.4g %.4g" % (x_m, y_m, z_m, x, y, z, w)


def describe_odometry(payload: bytes) -> str:
    """Return position and velocity in a nav_msgs/Odometry, for users; its length if it is too short."""
    if len(payload) < ODOMETRY_TAIL_LENGTH:
        return f"{len(payload)} bytes"
    pose, twist = POSE_FORM.unpack(payload[_ODOMETRY_POSE]), TWIST_FORM.unpack(payload[_ODOMETRY_TWIST])
    return "x %.4g m, y %.4g m, %.4g m/s, %.4g rad/s" % (*pose[:2], twist[0], twist[5])


def _holds_two_texts(data: bytes) -> bool:
    """Return whether data is two texts with their lengths in front, and nothing else."""
    position = 0
    for _ in range(2):
        if position + LENGTH.size > len(data):
            return False
        position += LENGTH.size + LENGTH.unpack_from(data, position)[0]
    return position == len(data)


Transform = Tuple[int, bytes, bytes]
"""Stamp (ns); frame_id and child_frame_id with their lengths, as on the wire; translation and rotation."""


def read_transforms(payload: bytes) -> Optional[List[Transform]]:
    """Return the transforms of a tf2_msgs/TFMessage, or None if it is not one from first to last byte."""
    if len(payload) < LENGTH.size:
        return None
    count = LENGTH.unpack_from(payload)[0]
    position = LENGTH.size
    transforms = []
    for _ in range(count):
        if position + HEADER.size > len(payload):
            return None
        _, secs, nsecs, length = HEADER.unpack_from(payload, position)
        child_start = position + HEADER.size + length
        if child_start + LENGTH.size > len(payload):
            return None
        frames_end = child_start + LENGTH.size + LENGTH.unpack_from(payload, child_start)[0]
        end = frames_end + TRANSFORM_TAIL_LENGTH
        if end > len(payload):
            return None
        frames_start = position + _SEQ_AND_STAMP.size
        transforms.append((secs * NS_PER_S + nsecs, payload[frames_start:frames_end], payload[frames_end:end]))
        position = end
    return transforms if position == len(payload) else None


# What a TFMessage with one transform holds where. Slices that exist already cost half of those made on the way.
TRANSFORM_START = slice(0, LENGTH.size + _SEQ_AND_STAMP.size)  # the number of transforms, seq and stamp
TRANSFORM = slice(LENGTH.size, None)
TRANSFORM_HEAD = slice(TRANSFORM.start, -TRANSFORM_TAIL_LENGTH)  # of the transform: seq, stamp and frames
TRANSFORM_FRAMES = slice(TRANSFORM_START.stop, -TRANSFORM_TAIL_LENGTH)
TRANSFORM_TAIL = slice(-TRANSFORM_TAIL_LENGTH, None)

read_transforms_start: Callable[[bytes], Tuple[int, int, int, int]] = struct.Struct("<4I").unpack_from
"""Returns the number of transforms in at least 16 bytes of a TFMessage, and seq, secs and nsecs of the first."""


def split_frames(frames: bytes) -> Tuple[bytes, bytes]:
    """Return (frame_id, child_frame_id) of a Transform's frames."""
    length = LENGTH.unpack_from(frames)[0]
    child = LENGTH.size + length
    return frames[LENGTH.size : child], frames[child + LENGTH.size :]


def pack_transform_head(stamp_ns: int, frames: bytes) -> bytes:
    """Return the bytes of one geometry_msgs/TransformStamped up to its tail (seq 0)."""
    secs, nsecs = divmod(stamp_ns, NS_PER_S)
    return _SEQ_AND_STAMP.pack(0, secs, nsecs) + frames


_STOCK_SCAN_TAIL = struct.Struct(SCAN_FORM % (STOCK_BEAMS, STOCK_BEAMS))


def make_proximity(payload: bytes, seq: int, stamp_ns: int, scan_time_s: float) -> Optional[bytes]:
    """Return the sensor_msgs/LaserScan of the eight beams in a stock laser message, by REP 117; None if it is not one.

    Of its 16 ranges the odd ones are averages, its increment matches none, and nothing in range is a finite value
    (RangeSensor.ino:66-72, 123-125, 167-173). NaN stays: it stands for a sensor without calibration only.
    """
    end = len(payload) - _STOCK_SCAN_TAIL.size  # of the header
    if end < HEADER.size or HEADER.size + HEADER.unpack_from(payload)[3] != end:
        return None
    fields = _STOCK_SCAN_TAIL.unpack_from(payload, end)
    if fields[7] != STOCK_BEAMS or fields[24] != STOCK_BEAMS:
        return None
    range_min_m, range_max_m = BODY_RADIUS_M + MIN_RIM_RANGE_M, BODY_RADIUS_M + MAX_RIM_RANGE_M
    ranges_m = []
    for range_m in fields[8:24:2]:
        if range_m >= range_max_m - CLAMP_TOLERANCE_M:
            range_m = math.inf
        elif range_m <= range_min_m + CLAMP_TOLERANCE_M:
            range_m = -math.inf
        ranges_m.append(range_m)
    head = restamp(payload[:end], seq, stamp_ns)
    return encode_turn_scan(head, scan_time_s, (range_min_m, range_max_m), ranges_m, fields[25:41:2])


_DISTANCE = struct.Struct("<f")
_RANGE = struct.Struct("<B4f")
_INFRARED = 1  # sensor_msgs/Range.INFRARED


def make_range(payload: bytes, seq: int, stamp_ns: int, frame_id: str) -> Optional[bytes]:
    """Return the sensor_msgs/Range of a distance (m) in a std_msgs/Float32, by REP 117; None if it is not one."""
    if len(payload) != _DISTANCE.size:
        return None
    distance_m: float = _DISTANCE.unpack(payload)[0]
    if distance_m > MAX_DISTANCE_M:
        distance_m = math.inf
    elif distance_m < MIN_DISTANCE_M:
        distance_m = -math.inf
    head = encode_header(seq, frame_id, divmod(stamp_ns, NS_PER_S))
    return head + _RANGE.pack(_INFRARED, DISTANCE_CONE_RAD, MIN_DISTANCE_M, MAX_DISTANCE_M, distance_m)


def _make_diagonal(values: Sequence[float]) -> List[float]:
    matrix = [0.0] * 36
    matrix[::7] = values
    return matrix
