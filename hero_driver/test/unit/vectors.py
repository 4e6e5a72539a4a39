"""Packets and declarations of the stock robot, written by hand, for tests of the rosserial core.

Nothing here uses the code under test: packets are hexadecimal digits, or put together by build_packet() below
with plain sums.
"""

import struct
from typing import NamedTuple


class Vector(NamedTuple):
    """One packet and what it holds."""

    name: str
    data: bytes
    topic_id: int
    payload: bytes


def build_packet(topic_id, payload):
    """Return the packet that carries payload, by the words of the protocol, without struct tables or tricks."""
    length = [len(payload) % 256, len(payload) // 256]
    topic = [topic_id % 256, topic_id // 256]
    head = [0xFF, 0xFE, *length, 255 - sum(length) % 256, *topic]
    return bytes(head) + payload + bytes([255 - (sum(topic) + sum(payload)) % 256])


def build_text(text):
    """Return text as it lies in a payload: four bytes of length, then the bytes."""
    data = text.encode()
    return len(data).to_bytes(4, "little") + data


def build_declaration(frame_id, topic_id, name, message_type, md5sum, buffer_length=4096):
    """Return the packet with which the robot declares one topic."""
    payload = topic_id.to_bytes(2, "little") + build_text(name) + build_text(message_type) + build_text(md5sum)
    return build_packet(frame_id, payload + buffer_length.to_bytes(4, "little", signed=True))


def build_log(level, text):
    """Return the packet with one log line of the robot."""
    return build_packet(7, bytes([level]) + build_text(text))


REQUEST = bytes.fromhex("ff fe 00 00 ff 00 00 ff")
TIME_REQUEST = bytes.fromhex("ff fe 08 00 f7 0a 00 0000000000000000 f5")
TX_STOP = bytes.fromhex("ff fe 00 00 ff 0b 00 f4")

VECTORS = [
    Vector("request for topics", REQUEST, 0, b""),
    Vector("time request", TIME_REQUEST, 10, bytes(8)),
    Vector(
        "time answer",
        bytes.fromhex("ff fe 08 00 f7 0a 00 ee 17 01 6b 00 ca 9a 3b e5"),
        10,
        bytes.fromhex("ee17016b 00ca9a3b"),
    ),
    Vector("no more data (TX_STOP)", TX_STOP, 11, b""),
    Vector("laser on", bytes.fromhex("ff fe 01 00 fe 65 00 01 99"), 101, b"\x01"),
    Vector(
        "orange light",
        bytes.fromhex("ff fe 10 00 ef 64 00 0000803f 0000003f 00000000 0000803f de"),
        100,
        bytes.fromhex("0000803f 0000003f 00000000 0000803f"),
    ),
    Vector(
        "drive 0.1 m/s, turn -1 rad/s",
        bytes.fromhex("ff fe 30 00 cf 6d 00 9a9999999999b93f") + bytes(38) + bytes.fromhex("f0bf 54"),
        109,
        bytes.fromhex("9a9999999999b93f") + bytes(38) + bytes.fromhex("f0bf"),
    ),
    Vector(
        "declaration of /tf",
        bytes.fromhex("ff fe 41 00 be 00 00 8100 03000000 2f7466 0c000000 74662f74664d657373616765 20000000")
        + b"94810edda583a504dfda3829e70d7eec"
        + bytes.fromhex("00100000 67"),
        0,
        bytes.fromhex("8100 03000000")
        + b"/tf"
        + bytes.fromhex("0c000000")
        + b"tf/tfMessage"
        + bytes.fromhex("20000000")
        + b"94810edda583a504dfda3829e70d7eec"
        + bytes.fromhex("00100000"),
    ),
    Vector(
        "log line",
        bytes.fromhex("ff fe 14 00 eb 07 00 01 0f000000") + b"Reseting PID..." + bytes.fromhex("20"),
        7,
        bytes.fromhex("01 0f000000") + b"Reseting PID...",
    ),
    Vector(
        "727 bytes of zeros, as long as odometry",
        bytes.fromhex("ff fe d7 02 26 82 00") + bytes(727) + b"\x7d",
        130,
        bytes(727),
    ),
    Vector("300 times ff", bytes.fromhex("ff fe 2c 01 d2 82 00") + b"\xff" * 300 + b"\xa9", 130, b"\xff" * 300),
    Vector(
        "starts of packets inside",
        bytes.fromhex("ff fe 06 00 f9 80 00 fffe fffe fffe 88"),
        128,
        bytes.fromhex("fffefffefffe"),
    ),
    Vector("length checksum of 00", bytes.fromhex("ff fe ff 00 00 80 00") + bytes(255) + b"\x7f", 128, bytes(255)),
    Vector("id above 255", bytes.fromhex("ff fe 01 00 fe 02 01 07 f5"), 258, b"\x07"),
]
GOOD = VECTORS[4]
"""What follows the broken packets in tests."""

TWIST_MD5 = "9f195f881246fdfa2798d1d3eebca84a"
ANSWER_MD5 = "937c9679a518e3a18d831e57125ea522"
SET_PID_MD5 = "f0d0bdba02bc62a48d52638e38dc8a4b"
MOTOR_MD5 = "44d4249d207ce6a89de3d72080e4d0b5"
EMPTY_MD5 = "d41d8cd98f00b204e9800998ecf8427e"

# id of the declaring packet, id, name, type, md5: as firmware v3.8 declares itself, in its order.
STOCK_TOPICS = [
    (0, 125, "/hero_0/laser", "sensor_msgs/LaserScan", "90c7ef2dc6895d81024acba2ac42f369"),
    (2, 126, "/hero_0/ir_calibration", "hero_common/SetIRCalibration", ANSWER_MD5),
    (0, 127, "/hero_0/imu", "sensor_msgs/Imu", "6a62c6daae103f4ff57a132d6f95cec2"),
    (0, 128, "/hero_0/encoder", "hero_common/Encoder", "b5586cdbae9b740afc6a1f403a2d7dde"),
    (0, 129, "/tf", "tf/tfMessage", "94810edda583a504dfda3829e70d7eec"),
    (0, 130, "/hero_0/odom", "nav_msgs/Odometry", "cd5e73d190d741a2f92e81eda573aca7"),
    (2, 131, "/hero_0/set_odom", "hero_common/SetOdom", ANSWER_MD5),
    (2, 132, "/hero_0/motors_parameters", "hero_common/SetMotor", ANSWER_MD5),
    (2, 133, "/hero_0/position_controller/pid_parameters", "hero_common/SetPID", ANSWER_MD5),
    (2, 134, "/hero_0/position_controller/pid_calibration", "std_srvs/Trigger", ANSWER_MD5),
    (2, 135, "/hero_0/velocity_controller/pid_parameters", "hero_common/SetPID", ANSWER_MD5),
    (2, 136, "/hero_0/velocity_controller/pid_calibration", "std_srvs/Trigger", ANSWER_MD5),
    (1, 100, "/hero_0/led", "std_msgs/ColorRGBA", "a29a96539573343b1310c73607334b00"),
    (1, 101, "hero_0/laser_enable", "std_msgs/Bool", "8b94c1b53db61fb6aed406028ad6332a"),
    (3, 102, "/hero_0/ir_calibration", "hero_common/SetIRCalibration", "27748d949ad62e65750ad22074426005"),
    (3, 103, "/hero_0/set_odom", "hero_common/SetOdom", "938fa65709584ad8e77d238529be13b8"),
    (1, 104, "/hero_0/cmd_motor", "hero_common/Motor", MOTOR_MD5),
    (3, 105, "/hero_0/motors_parameters", "hero_common/SetMotor", MOTOR_MD5),
    (1, 106, "/hero_0/position_controller/cmd_vel", "geometry_msgs/Twist", TWIST_MD5),
    (3, 107, "/hero_0/position_controller/pid_parameters", "hero_common/SetPID", SET_PID_MD5),
    (3, 108, "/hero_0/position_controller/pid_calibration", "std_srvs/Trigger", EMPTY_MD5),
    (1, 109, "/hero_0/velocity_controller/cmd_vel", "geometry_msgs/Twist", TWIST_MD5),
    (3, 110, "/hero_0/velocity_controller/pid_parameters", "hero_common/SetPID", SET_PID_MD5),
    (3, 111, "/hero_0/velocity_controller/pid_calibration", "std_srvs/Trigger", EMPTY_MD5),
]
FROM_ROBOT = [topic_id for frame_id, topic_id, *_ in STOCK_TOPICS if frame_id in (0, 2)]

HANDSHAKE = TIME_REQUEST + b"".join(build_declaration(*topic) for topic in STOCK_TOPICS)
"""What a stock robot answers to a request, in one burst."""

ODOM_MESSAGE = build_packet(130, struct.pack("<I", 4294967295) + bytes(723))
ENCODER_MESSAGE = build_packet(128, struct.pack("<I", 4294967295) + bytes(114))
