"""The robot's messages as bytes, as the stock firmware writes them.

Pure. What is sent in each cycle is built once per robot as a template, of which only the fields that change are
patched, so that a hundred robots cost little. float64 fields hold float32 values, because the robot's ros_lib computes
in single precision (serializeAvrFloat64). Field order: the ROS message definitions.
"""

import functools
import math
import struct
from typing import List, Sequence, Tuple

from hero_driver.rosserial import packets
from hero_node import Pose
from hero_node.robot_constants import TICKS_PER_TURN, WHEEL_SEPARATION_M
from hero_node.ros_messages import (
    COVARIANCE_FORM,
    ENCODER_FORM,
    POSE_FORM,
    TWIST_FORM,
    encode_header,
    encode_odometry,
    encode_scan,
    encode_text,
    encode_transforms,
)

from .models import HERO, RobotModel

SEQ_NEVER_COUNTED = 0xFFFFFFFF
"""header.seq of odom, encoder and imu: set to -1 and never counted (Odometry.ino:60, WheelEncoder.ino:62)."""

_STAMP = struct.Struct("<II")
_QUATERNION = struct.Struct("<4d")
_PLUS_ENCODER = struct.Struct("<12d")
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


@functools.lru_cache(maxsize=None)
def _make_float32s(count: int) -> struct.Struct:
    return struct.Struct("<%df" % count)


def round_to_float32(values: Sequence[float]) -> Tuple[float, ...]:
    """Return values as the robot's single precision holds them."""
    form = _make_float32s(len(values))
    return form.unpack(form.pack(*values))


class CycleMessages:
    """One odom packet, five transforms and one encoder packet: what a robot sends 29 times a second."""

    def __init__(self, name: str, model: RobotModel = HERO) -> None:
        """Build the templates of the robot called name (hero_N)."""
        self._encoder_form = _PLUS_ENCODER if model.is_plus else ENCODER_FORM
        odom_id, base_id = name + "/odom", name + "/base_link"
        odom = encode_odometry(odom_id, base_id, (0, 0), Pose(0.0, 0.0, 0.0), (0.0, 0.0), SEQ_NEVER_COUNTED)
        encoder = encode_header(SEQ_NEVER_COUNTED, name + "/encoder") + bytes(self._encoder_form.size)
        transforms = [
            _build_transform(odom_id, base_id, (0.0, 0.0, 0.0)),
            _build_transform(base_id, name + "/left_wheel_link", (0.0, _WHEEL_Y_M, _WHEEL_Z_M)),
            _build_transform(base_id, name + "/right_wheel_link", (0.0, -_WHEEL_Y_M, _WHEEL_Z_M)),
            _build_transform(base_id, name + "/hat_link", _HAT_M),
            _build_transform(base_id, name + "/laser_link", _LASER_M),
        ]
        payloads = [("odom", odom), *(("tf", transform) for transform in transforms), ("encoder", encoder)]
        self._data = bytearray()
        self._sums: List[Tuple[int, int]] = []  # first byte that is summed, and the checksum's place behind the last
        sent_ids, starts, ends = model.sent_ids, [], []
        for topic, payload in payloads:
            start = len(self._data)
            self._data += packets.encode_packet(sent_ids[topic], payload)
            starts.append(start + packets.HEADER_LENGTH)
            ends.append(len(self._data) - 1)
            self._sums.append((start + _SUMMED_OFFSET, ends[-1]))
        # Behind the sequence number; in a tfMessage the number of transforms comes first.
        self._stamps = [starts[0] + 4] + [start + 8 for start in starts[1:6]] + [starts[6] + 4]
        self._twist = ends[0] - COVARIANCE_FORM.size - TWIST_FORM.size
        self._poses = (self._twist - COVARIANCE_FORM.size - POSE_FORM.size, ends[1] - POSE_FORM.size)
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
        data = self._data
        for place in self._stamps:
            _STAMP.pack_into(data, place, *stamp)
        for place in self._poses:
            POSE_FORM.pack_into(data, place, x_m, y_m, 0.0, 0.0, 0.0, yaw_z, yaw_w)
        TWIST_FORM.pack_into(data, self._twist, linear, 0.0, 0.0, 0.0, 0.0, angular)
        _QUATERNION.pack_into(data, self._left_wheel, 0.0, left_y, 0.0, left_w)
        _QUATERNION.pack_into(data, self._right_wheel, 0.0, right_y, 0.0, right_w)
        if self._encoder_form is _PLUS_ENCODER:
            values.insert(6, abs(values[0] - values[1]))
        self._encoder_form.pack_into(data, self._encoder, *values)
        view = memoryview(data)
        for first, last in self._sums:
            data[last] = 255 - packets.sum_bytes(view[first:last])
        return bytes(data)


def _build_transform(parent: str, child: str, place_m: Sequence[float]) -> bytes:
    """Return a tfMessage with one transform, without rotation."""
    x_m, y_m, z_m = round_to_float32(place_m)
    return encode_transforms((0, 0), [(parent, child, (x_m, y_m, 0.0, z_m))])


def _wheel_half_angle(ticks: float) -> float:
    # `ticks % 288 + 1` as in C, where the remainder has the sign of ticks (Odometry.ino:182).
    return (math.fmod(ticks, TICKS_PER_TURN) + 1.0) * math.pi / TICKS_PER_TURN


def encode_laser(
    name: str, seq: int, stamp: Tuple[int, int], ranges_m: Sequence[float], counts: Sequence[float]
) -> bytes:
    """Return the stock LaserScan of the eight sensors.

    Odd values are averages of their neighbors (quirk of the firmware, RangeSensor.ino:167).
    """
    settings = (-math.pi, math.pi, LASER_ANGLE_INCREMENT_RAD, 0.0, 0.0, LASER_RANGE_MIN_M, LASER_RANGE_MAX_M)
    header = encode_header(seq, name + "/laser_link", stamp)
    return encode_scan(header, settings, _interpolate(ranges_m), _interpolate(counts))


def _interpolate(values: Sequence[float]) -> List[float]:
    """Return values with the average of each and its successor in between."""
    filled: List[float] = []
    for index, value in enumerate(values):
        filled += [value, (value + values[(index + 1) % len(values)]) / 2.0]
    return filled


def encode_imu(name: str, stamp: Tuple[int, int], heading_rad: float, angular_counts: float) -> bytes:
    """Return the Imu of a hat that turns about z only.

    Angular speeds are raw counts, accelerations counts / 1000 (IMUSensor.ino:182-188).
    """
    turn = math.sin(heading_rad / 2.0) * _UNIT_QUATERNION, math.cos(heading_rad / 2.0) * _UNIT_QUATERNION
    yaw_z, yaw_w, angular_z, gravity = round_to_float32((*turn, angular_counts, _GRAVITY))
    turned = (0.0, 0.0, yaw_z, yaw_w, *[0.0] * 9, 0.0, 0.0, angular_z, *_ANGULAR_COVARIANCE)
    values = struct.pack("<37d", *turned, 0.0, 0.0, gravity, *_LINEAR_COVARIANCE)
    return encode_header(SEQ_NEVER_COUNTED, name + "/hat_link", stamp) + values


def encode_answer(success: bool, text: str) -> bytes:
    """Return the payload of a service's response: bool success, string message."""
    return bytes((success,)) + encode_text(text)
