"""The robot's messages <-> the bytes of their frames, as the stock firmware writes them.

Pure. A message is built once per robot as a template; afterwards only the fields that change are patched, so
that a hundred robots cost little. float64 fields hold float32 values, because the robot's ros_lib computes in
single precision (serializeAvrFloat64). Field order: the ROS message definitions.
"""

import math
import struct
from typing import List, NamedTuple, Sequence, Tuple

from hero_driver.rosserial import packets

from ..errors import CommandError
from ..robot_constants import TICKS_PER_TURN, WHEEL_SEPARATION_M
from . import declarations

SEQ_NEVER_COUNTED = 0xFFFFFFFF
"""header.seq of odom, encoder and imu: set to -1 and never counted (Odometry.ino:60, WheelEncoder.ino:62)."""

_STAMP = struct.Struct("<II")
_HEADER = struct.Struct("<III")
_LENGTH = struct.Struct("<I")

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


def round_to_float32(values: Sequence[float]) -> Tuple[float, ...]:
    """Return values as the robot's single precision holds them."""
    form = struct.Struct("<%df" % len(values))
    return form.unpack(form.pack(*values))


class _Template:
    """The frames of one burst as one buffer, of which fields are patched and the checksums made good."""

    def __init__(self, messages: Sequence[Tuple[int, bytes]]) -> None:
        self.data = bytearray()
        self.payload_starts: List[int] = []
        self._frames: List[Tuple[int, int, int]] = []  # first byte that is summed, checksum's place, payload
        for topic_id, payload in messages:
            start = len(self.data)
            self.data += packets.encode_packet(topic_id, payload)
            self._frames.append((start + 5, len(self.data) - 1, len(payload)))
            self.payload_starts.append(start + packets.HEADER_LENGTH)

    def seal(self) -> bytes:
        """Return the burst with right checksums."""
        view = memoryview(self.data)
        for first, last, _ in self._frames:
            self.data[last] = 255 - packets.sum_bytes(view[first:last])
        return bytes(self.data)


class CycleMessages:
    """One odom frame, five transforms and one encoder frame back to back: what a robot sends 29 times a
    second."""

    _POSE = struct.Struct("<7d")
    _TWIST = struct.Struct("<6d")
    _PLANE = struct.Struct("<6f")  # x, y, quaternion z and w, linear, turn
    _ENCODER = struct.Struct("<11d")
    _ENCODER32 = struct.Struct("<11f")
    _TURN = struct.Struct("<4d")
    _TURN32 = struct.Struct("<4f")

    def __init__(self, name: str) -> None:
        """Build the templates of the robot called name (hero_N)."""
        odom_id, base_id = name + "/odom", name + "/base_link"
        odom = _header(SEQ_NEVER_COUNTED, odom_id) + _text(base_id)
        self._odom_pose = len(odom)
        odom += struct.pack("<91d", *([0.0] * 91))[: 8 * (7 + 36 + 6 + 36)]
        encoder = _header(SEQ_NEVER_COUNTED, name + "/encoder")
        self._encoder_values = len(encoder)
        encoder += bytes(self._ENCODER.size)
        still = (0.0, 0.0, 0.0, 1.0)
        transforms = [
            self._build_transform(odom_id, base_id, (0.0, 0.0, 0.0), still),
            self._build_transform(base_id, name + "/left_wheel_link", (0.0, _WHEEL_Y_M, _WHEEL_Z_M), still),
            self._build_transform(base_id, name + "/right_wheel_link", (0.0, -_WHEEL_Y_M, _WHEEL_Z_M), still),
            self._build_transform(base_id, name + "/hat_link", _HAT_M, still),
            self._build_transform(base_id, name + "/laser_link", _LASER_M, still),
        ]
        self._template = _Template(
            [(declarations.ID_ODOM, odom)]
            + [(declarations.ID_TF, transform) for transform in transforms]
            + [(declarations.ID_ENCODER, encoder)]
        )
        starts = self._template.payload_starts
        # Behind the sequence number; in a tfMessage the number of transforms comes first.
        self._stamps = [starts[0] + 4] + [start + 8 for start in starts[1:6]] + [starts[6] + 4]
        self._pose = starts[0] + self._odom_pose
        self._twist = self._pose + 8 * (7 + 36)
        self._tf_pose = starts[1] + len(transforms[0]) - self._POSE.size
        self._left_turn = starts[2] + len(transforms[1]) - self._TURN.size
        self._right_turn = starts[3] + len(transforms[2]) - self._TURN.size
        self._encoder = starts[6] + self._encoder_values

    @staticmethod
    def _build_transform(parent: str, child: str, place_m: Sequence[float], turn: Sequence[float]) -> bytes:
        values = round_to_float32(list(place_m) + list(turn))
        return _LENGTH.pack(1) + _header(0, parent) + _text(child) + struct.pack("<7d", *values)

    def encode(
        self,
        stamp: Tuple[int, int],
        pose: Tuple[float, float, float],
        twist: Tuple[float, float],
        tf_ticks: Tuple[float, float],
        encoder: Sequence[float],
    ) -> bytes:
        """Return the burst: pose (m, m, rad), twist (m/s, rad/s), ticks that the wheels' transforms show,
        and the eleven values of Encoder."""
        data = self._template.data
        for place in self._stamps:
            _STAMP.pack_into(data, place, *stamp)
        x, y, turn_z, turn_w, linear, turn = self._PLANE.unpack(
            self._PLANE.pack(
                pose[0], pose[1], math.sin(pose[2] / 2.0), math.cos(pose[2] / 2.0), twist[0], twist[1]
            )
        )
        for place in (self._pose, self._tf_pose):
            self._POSE.pack_into(data, place, x, y, 0.0, 0.0, 0.0, turn_z, turn_w)
        self._TWIST.pack_into(data, self._twist, linear, 0.0, 0.0, 0.0, 0.0, turn)
        left_rad, right_rad = (_wheel_half_angle(ticks) for ticks in tf_ticks)
        left_y, left_w, right_y, right_w = self._TURN32.unpack(
            self._TURN32.pack(
                math.sin(left_rad), math.cos(left_rad), math.sin(right_rad), math.cos(right_rad)
            )
        )
        self._TURN.pack_into(data, self._left_turn, 0.0, left_y, 0.0, left_w)
        self._TURN.pack_into(data, self._right_turn, 0.0, right_y, 0.0, right_w)
        values = self._ENCODER32.unpack(self._ENCODER32.pack(*encoder))
        self._ENCODER.pack_into(data, self._encoder, *values)
        return self._template.seal()


def _wheel_half_angle(ticks: float) -> float:
    # `ticks % 288 + 1` as in C, where the rest has the sign of ticks (Odometry.ino:182).
    return (math.fmod(ticks, TICKS_PER_TURN) + 1.0) * math.pi / TICKS_PER_TURN


class LaserMessages:
    """The stock LaserScan of one robot."""

    def __init__(self, name: str) -> None:
        """Build the template of the robot called name (hero_N)."""
        head = _header(0, name + "/laser_link")
        head += struct.pack(
            "<7f",
            -math.pi,
            math.pi,
            LASER_ANGLE_INCREMENT_RAD,
            0.0,
            0.0,
            LASER_RANGE_MIN_M,
            LASER_RANGE_MAX_M,
        )
        self._template = _Template(
            [(declarations.ID_LASER, head + _LENGTH.pack(16) + bytes(64) + _LENGTH.pack(16) + bytes(64))]
        )
        self._start = self._template.payload_starts[0]
        self._ranges = self._start + len(head) + 4

    def encode(
        self, seq: int, stamp: Tuple[int, int], ranges_m: Sequence[float], counts: Sequence[float]
    ) -> bytes:
        """Return the frame for the eight sensors: odd values are averages of their neighbours (quirk of the
        firmware, RangeSensor.ino:167)."""
        data = self._template.data
        _HEADER.pack_into(data, self._start, seq & 0xFFFFFFFF, *stamp)
        struct.pack_into("<16f", data, self._ranges, *_fill_between(ranges_m))
        struct.pack_into("<16f", data, self._ranges + 68, *_fill_between(counts))
        return self._template.seal()


def _fill_between(values: Sequence[float]) -> List[float]:
    filled: List[float] = []
    for index, value in enumerate(values):
        filled += [value, (value + values[(index + 1) % len(values)]) / 2.0]
    return filled


class ImuMessages:
    """The Imu of the hat: turn rates in raw counts, acceleration in counts / 1000 (IMUSensor.ino:182-188)."""

    def __init__(self, name: str) -> None:
        """Build the template of the robot called name (hero_N)."""
        head = _header(SEQ_NEVER_COUNTED, name + "/hat_link")
        values = [0.0] * 4 + [0.0] * 9 + [0.0] * 3 + list(_ANGULAR_COVARIANCE) + [0.0] * 3
        values += list(_LINEAR_COVARIANCE)
        self._template = _Template([(declarations.ID_IMU, head + struct.pack("<37d", *values))])
        start = self._template.payload_starts[0]
        self._stamp = start + 4
        self._turn = start + len(head)

    def encode(
        self,
        stamp: Tuple[int, int],
        quaternion: Sequence[float],
        turn_counts: Sequence[float],
        acceleration: Sequence[float],
    ) -> bytes:
        """Return the frame; quaternion is x y z w."""
        data = self._template.data
        _STAMP.pack_into(data, self._stamp, *stamp)
        struct.pack_into("<4d", data, self._turn, *round_to_float32(quaternion))
        struct.pack_into("<3d", data, self._turn + 8 * 13, *round_to_float32(turn_counts))
        struct.pack_into("<3d", data, self._turn + 8 * 25, *round_to_float32(acceleration))
        return self._template.seal()


def encode_answer(success: bool, text: str) -> bytes:
    """Return the payload of a service's response: bool success, string message."""
    return bytes((1 if success else 0,)) + _text(text)


class Twist(NamedTuple):
    """The two parts of a Twist that the robot uses."""

    linear_m_s: float
    turn_rad_s: float


def _unpack(form: str, payload: bytes, what: str) -> Tuple:
    if len(payload) != struct.calcsize(form):
        raise CommandError("%s has %d bytes instead of %d" % (what, len(payload), struct.calcsize(form)))
    return struct.unpack(form, payload)


def _refuse_unusable(values: Sequence[float], what: str) -> None:
    # The firmware would compute on with it; nobody can say what a real robot does then.
    if not all(abs(value) < 1e30 for value in values):
        raise CommandError("%s with %s, with which a real robot would do anything" % (what, list(values)))


def decode_twist(payload: bytes) -> Twist:
    """Return what a geometry_msgs/Twist commands. Raises: CommandError for a wrong length."""
    values = _unpack("<6d", payload, "Twist")
    _refuse_unusable((values[0], values[5]), "Twist")
    return Twist(values[0], values[5])


def decode_motor(payload: bytes) -> Tuple[int, int]:
    """Return the servo pulses (us) of a Motor message or a SetMotor request. Raises: CommandError."""
    return _unpack("<2h", payload, "Motor")


def decode_color(payload: bytes) -> Tuple[float, float, float, float]:
    """Return red, green, blue and alpha (0..1) of a ColorRGBA. Raises: CommandError."""
    return _unpack("<4f", payload, "ColorRGBA")


def decode_bool(payload: bytes) -> bool:
    """Return a std_msgs/Bool. Raises: CommandError."""
    return bool(_unpack("<B", payload, "Bool")[0])


def decode_set_odom(payload: bytes) -> Tuple[float, float, float]:
    """Return the pose (m, m, rad) of a SetOdom request. Raises: CommandError."""
    values = _unpack("<3d", payload, "SetOdom")
    _refuse_unusable(values, "SetOdom")
    return values


def decode_pid(payload: bytes) -> Tuple[float, ...]:
    """Return lkp lki lkd rkp rki rkd of a SetPID request. Raises: CommandError."""
    gains = _unpack("<6f", payload, "SetPID")
    _refuse_unusable(gains, "SetPID")
    return gains


def decode_ir_calibration(payload: bytes) -> Tuple[float, ...]:
    """Return the eight constants (counts m^2) of a SetIRCalibration request. Raises: CommandError."""
    return _unpack("<8d", payload, "SetIRCalibration")
