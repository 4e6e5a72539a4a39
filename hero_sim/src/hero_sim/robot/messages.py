"""The robot's messages as the bytes of their packets, as the stock firmware writes them.

Pure. A message is built once per robot as a template; afterwards only the fields that change are patched, so
that a hundred robots cost little. float64 fields hold float32 values, because the robot's ros_lib computes in
single precision (serializeAvrFloat64). Field order: the ROS message definitions.
"""

import functools
import math
import struct
from typing import List, Sequence, Tuple

from hero_driver.rosserial import packets
from hero_node.geometry import Pose

from ..robot_constants import TICKS_PER_TURN, WHEEL_SEPARATION_M
from . import declarations
from .models import HERO, RobotModel

SEQ_NEVER_COUNTED = 0xFFFFFFFF
"""header.seq of odom, encoder and imu: set to -1 and never counted (Odometry.ino:60, WheelEncoder.ino:62)."""

_STAMP = struct.Struct("<II")
_HEADER = struct.Struct("<III")
_LENGTH = struct.Struct("<I")
_POSE = struct.Struct("<7d")
_TWIST = struct.Struct("<6d")
_QUATERNION = struct.Struct("<4d")
_ENCODER = struct.Struct("<11d")
_PLUS_ENCODER = struct.Struct("<12d")
_COVARIANCE_LENGTH = 36 * 8
_SUMMED_OFFSET = 5  # sync, length and its checksum are not part of a packet's last checksum

# Places of the robot's parts in base_link (m), as the firmware sends them in its transforms.
_WHEEL_Y_M = WHEEL_SEPARATION_M / 2.0
_WHEEL_Z_M = 0.01548
_HAT_M = (-0.00245, -0.00216, 0.051)
_LASER_M = (0.0, 0.0, 0.051)

LASER_ANGLE_INCREMENT_RAD = 0.395
LASER_RANGE_MIN_M = 0.036835
LASER_RANGE_MAX_M = 0.236835
"""Fields of the stock LaserScan; the increment fits neither 15 nor 16 steps of a turn
(RangeSensor.ino:67-72)."""

_UNIT_QUATERNION = 16383.0 / 16384.0
"""The largest part of a quaternion that the hat sends (0.99994, a 14-bit fixed point number)."""

_GRAVITY = 8.192
"""1 g in the hat's unit: raw counts / 1000 (IMUSensor.ino:182-188)."""

_ANGULAR_COVARIANCE = (
    0.6175054311752319, -0.22783495485782623, -0.3221839368343353,
    -0.22783495485782623, 1.7157649993896484, 0.24605797231197357,
    -0.3221839368343353, 0.24605797231197357, 0.6366726756095886,
)  # fmt: skip
_LINEAR_COVARIANCE = (
    0.002516058273613453, -0.0007089563878253102, -0.00014545791782438755,
    -0.0007089563878253102, 0.002006256952881813, 3.710795863298699e-05,
    -0.00014545791782438755, 3.710795863298699e-05, 5.777423575636931e-05,
)  # fmt: skip


def _text(value: str) -> bytes:
    data = value.encode("ascii")
    return _LENGTH.pack(len(data)) + data


def _header(seq: int, frame_id: str) -> bytes:
    return _HEADER.pack(seq, 0, 0) + _text(frame_id)


@functools.lru_cache(maxsize=None)
def _make_float32s(count: int) -> struct.Struct:
    return struct.Struct("<%df" % count)


def round_to_float32(values: Sequence[float]) -> Tuple[float, ...]:
    """Return values as the robot's single precision holds them."""
    form = _make_float32s(len(values))
    return form.unpack(form.pack(*values))


class _Template:
    """The packets of one burst in one buffer, of which fields are patched and the checksums updated."""

    def __init__(self, messages: Sequence[Tuple[int, bytes]]) -> None:
        self.data = bytearray()
        self.payload_starts: List[int] = []
        self._sums: List[Tuple[int, int]] = []  # first byte that is summed, and the checksum's place behind the last
        for topic_id, payload in messages:
            start = len(self.data)
            self.data += packets.encode_packet(topic_id, payload)
            self._sums.append((start + _SUMMED_OFFSET, len(self.data) - 1))
            self.payload_starts.append(start + packets.HEADER_LENGTH)

    def seal(self) -> bytes:
        """Return the burst with right checksums."""
        view = memoryview(self.data)
        for first, last in self._sums:
            self.data[last] = 255 - packets.sum_bytes(view[first:last])
        return bytes(self.data)


class CycleMessages:
    """One odom packet, five transforms and one encoder packet: what a robot sends 29 times a second."""

    def __init__(self, name: str, model: RobotModel = HERO) -> None:
        """Build the templates of the robot called name (hero_N)."""
        own_ids = model.own_ids
        self._encoder_form = _ENCODER if model.encoder_md5 is None else _PLUS_ENCODER
        odom_id, base_id = name + "/odom", name + "/base_link"
        odom = _header(SEQ_NEVER_COUNTED, odom_id) + _text(base_id)
        odom += bytes(_POSE.size + _COVARIANCE_LENGTH + _TWIST.size + _COVARIANCE_LENGTH)
        encoder = _header(SEQ_NEVER_COUNTED, name + "/encoder") + bytes(self._encoder_form.size)
        transforms = [
            _build_transform(odom_id, base_id, (0.0, 0.0, 0.0)),
            _build_transform(base_id, name + "/left_wheel_link", (0.0, _WHEEL_Y_M, _WHEEL_Z_M)),
            _build_transform(base_id, name + "/right_wheel_link", (0.0, -_WHEEL_Y_M, _WHEEL_Z_M)),
            _build_transform(base_id, name + "/hat_link", _HAT_M),
            _build_transform(base_id, name + "/laser_link", _LASER_M),
        ]
        messages = [(own_ids[declarations.ID_ODOM], odom)]
        messages += [(own_ids[declarations.ID_TF], transform) for transform in transforms]
        messages += [(own_ids[declarations.ID_ENCODER], encoder)]
        self._template = _Template(messages)
        starts = self._template.payload_starts
        ends = [start + len(payload) for start, (_, payload) in zip(starts, messages)]
        # Behind the sequence number; in a tfMessage the number of transforms comes first.
        self._stamps = [starts[0] + 4] + [start + 8 for start in starts[1:6]] + [starts[6] + 4]
        self._twist = ends[0] - _COVARIANCE_LENGTH - _TWIST.size
        self._poses = (self._twist - _COVARIANCE_LENGTH - _POSE.size, ends[1] - _POSE.size)
        self._left_wheel = ends[2] - _QUATERNION.size
        self._right_wheel = ends[3] - _QUATERNION.size
        self._encoder = ends[6] - self._encoder_form.size

    def encode(
        self,
        stamp: Tuple[int, int],
        pose: Pose,
        twist: Tuple[float, float],
        tf_ticks: Tuple[float, float],
        encoder: Sequence[float],
    ) -> bytes:
        """Return the burst: twist (m/s, rad/s), ticks as the wheels' transforms show them, the values of Encoder."""
        half_rad = pose.yaw_rad / 2.0
        left_rad, right_rad = _wheel_half_angle(tf_ticks[0]), _wheel_half_angle(tf_ticks[1])
        x_m, y_m, yaw_z, yaw_w, linear, angular, left_y, left_w, right_y, right_w, *values = round_to_float32(
            (pose.x_m, pose.y_m, math.sin(half_rad), math.cos(half_rad), *twist)
            + (math.sin(left_rad), math.cos(left_rad), math.sin(right_rad), math.cos(right_rad), *encoder)
        )
        data = self._template.data
        for place in self._stamps:
            _STAMP.pack_into(data, place, *stamp)
        for place in self._poses:
            _POSE.pack_into(data, place, x_m, y_m, 0.0, 0.0, 0.0, yaw_z, yaw_w)
        _TWIST.pack_into(data, self._twist, linear, 0.0, 0.0, 0.0, 0.0, angular)
        _QUATERNION.pack_into(data, self._left_wheel, 0.0, left_y, 0.0, left_w)
        _QUATERNION.pack_into(data, self._right_wheel, 0.0, right_y, 0.0, right_w)
        if self._encoder_form is _PLUS_ENCODER:
            values.insert(6, abs(values[0] - values[1]))
        self._encoder_form.pack_into(data, self._encoder, *values)
        return self._template.seal()


def _build_transform(parent: str, child: str, place_m: Sequence[float]) -> bytes:
    """Return a tfMessage with one transform, without rotation."""
    values = round_to_float32((*place_m, 0.0, 0.0, 0.0, 1.0))
    return _LENGTH.pack(1) + _header(0, parent) + _text(child) + _POSE.pack(*values)


def _wheel_half_angle(ticks: float) -> float:
    # `ticks % 288 + 1` as in C, where the remainder has the sign of ticks (Odometry.ino:182).
    return (math.fmod(ticks, TICKS_PER_TURN) + 1.0) * math.pi / TICKS_PER_TURN


class LaserMessages:
    """The stock LaserScan of one robot."""

    def __init__(self, name: str) -> None:
        """Build the template of the robot called name (hero_N)."""
        angles_rad = (-math.pi, math.pi, LASER_ANGLE_INCREMENT_RAD)
        head = _header(0, name + "/laser_link")
        head += struct.pack("<7f", *angles_rad, 0.0, 0.0, LASER_RANGE_MIN_M, LASER_RANGE_MAX_M)
        values = _LENGTH.pack(16) + bytes(64)
        self._template = _Template([(declarations.ID_LASER, head + values + values)])
        self._start = self._template.payload_starts[0]
        self._ranges = self._start + len(head) + _LENGTH.size

    def encode(
        self, seq: int, stamp: Tuple[int, int], ranges_m: Sequence[float], counts: Sequence[float]
    ) -> bytes:
        """Return the packet for the eight sensors: odd values are averages of their neighbors (quirk of the
        firmware, RangeSensor.ino:167)."""
        data = self._template.data
        _HEADER.pack_into(data, self._start, seq & 0xFFFFFFFF, *stamp)
        struct.pack_into("<16f", data, self._ranges, *_interpolate(ranges_m))
        struct.pack_into("<16f", data, self._ranges + 64 + _LENGTH.size, *_interpolate(counts))
        return self._template.seal()


def _interpolate(values: Sequence[float]) -> List[float]:
    """Return values with the average of each and its successor in between."""
    filled: List[float] = []
    for index, value in enumerate(values):
        filled += [value, (value + values[(index + 1) % len(values)]) / 2.0]
    return filled


class ImuMessages:
    """The Imu of the hat: angular speeds in raw counts, acceleration in counts / 1000 (IMUSensor.ino:182-188)."""

    def __init__(self, name: str, model: RobotModel = HERO) -> None:
        """Build the template of the robot called name (hero_N)."""
        head = _header(SEQ_NEVER_COUNTED, name + "/hat_link")
        gravity = round_to_float32((0.0, 0.0, _GRAVITY))
        values = [0.0] * (4 + 9 + 3) + [*_ANGULAR_COVARIANCE, *gravity, *_LINEAR_COVARIANCE]
        self._template = _Template([(model.own_ids[declarations.ID_IMU], head + struct.pack("<37d", *values))])
        start = self._template.payload_starts[0]
        self._stamp = start + 4
        self._quaternion = start + len(head)

    def encode(self, stamp: Tuple[int, int], heading_rad: float, angular_counts: float) -> bytes:
        """Return the packet of a robot that turns about z only."""
        data = self._template.data
        turn = math.sin(heading_rad / 2.0) * _UNIT_QUATERNION, math.cos(heading_rad / 2.0) * _UNIT_QUATERNION
        yaw_z, yaw_w, angular_z = round_to_float32((*turn, angular_counts))
        _STAMP.pack_into(data, self._stamp, *stamp)
        _QUATERNION.pack_into(data, self._quaternion, 0.0, 0.0, yaw_z, yaw_w)
        struct.pack_into("<d", data, self._quaternion + 8 * 15, angular_z)
        return self._template.seal()


def encode_answer(success: bool, text: str) -> bytes:
    """Return the payload of a service's response: bool success, string message."""
    return bytes((success,)) + _text(text)
