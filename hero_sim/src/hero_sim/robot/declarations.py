"""What one robot declares: its topics and services in the stock order, with the stock ids.

Pure. Source: TopicInfo frames of the stock robot (firmware v3.8); ids are given in call order, publishers
from 125 (100 + 25 subscriber slots) and subscribers from 100 (ros.h of the firmware).
"""

from typing import List, NamedTuple, Tuple

from hero_driver.rosserial import packets, payloads

BUFFER_LENGTH = 4096
"""INPUT_SIZE and OUTPUT_SIZE of the firmware's NodeHandle."""

ANSWER_MD5 = "937c9679a518e3a18d831e57125ea522"
"""The response of every service of the robot: bool success, string message."""

ID_LASER = 125
ID_IR_CALIBRATION_ANSWER = 126
ID_IMU = 127
ID_ENCODER = 128
ID_TF = 129
ID_ODOM = 130
ID_SET_ODOM_ANSWER = 131
ID_MOTORS_PARAMETERS_ANSWER = 132
ID_POSITION_PID_PARAMETERS_ANSWER = 133
ID_POSITION_PID_CALIBRATION_ANSWER = 134
ID_VELOCITY_PID_PARAMETERS_ANSWER = 135
ID_VELOCITY_PID_CALIBRATION_ANSWER = 136

ID_LED = 100
ID_LASER_ENABLE = 101
ID_IR_CALIBRATION = 102
ID_SET_ODOM = 103
ID_CMD_MOTOR = 104
ID_MOTORS_PARAMETERS = 105
ID_POSITION_CMD_VEL = 106
ID_POSITION_PID_PARAMETERS = 107
ID_POSITION_PID_CALIBRATION = 108
ID_VELOCITY_CMD_VEL = 109
ID_VELOCITY_PID_PARAMETERS = 110
ID_VELOCITY_PID_CALIBRATION = 111

ID_LAST_SUBSCRIBER_SLOT = 124
"""Last of the 25 slots: ids 112..124 are ignored, anything above reads outside the robot's table."""


class Declaration(NamedTuple):
    """One endpoint; %s in the name stands for hero_N."""

    kind: int  # the id of the frame that declares it
    topic_id: int
    name: str
    message_type: str
    md5sum: str


_PUB = packets.ID_PUBLISHER
_SUB = packets.ID_SUBSCRIBER
_ANS = packets.ID_SERVICE_SERVER_PUBLISHER
_REQ = packets.ID_SERVICE_SERVER_SUBSCRIBER

_TWIST_MD5 = "9f195f881246fdfa2798d1d3eebca84a"
_MOTOR_MD5 = "44d4249d207ce6a89de3d72080e4d0b5"
_PID_MD5 = "f0d0bdba02bc62a48d52638e38dc8a4b"
_EMPTY_MD5 = "d41d8cd98f00b204e9800998ecf8427e"

DECLARATIONS: Tuple[Declaration, ...] = (
    Declaration(_PUB, ID_LASER, "/%s/laser", "sensor_msgs/LaserScan", "90c7ef2dc6895d81024acba2ac42f369"),
    Declaration(
        _ANS, ID_IR_CALIBRATION_ANSWER, "/%s/ir_calibration", "hero_common/SetIRCalibration", ANSWER_MD5
    ),
    Declaration(_PUB, ID_IMU, "/%s/imu", "sensor_msgs/Imu", "6a62c6daae103f4ff57a132d6f95cec2"),
    Declaration(_PUB, ID_ENCODER, "/%s/encoder", "hero_common/Encoder", "b5586cdbae9b740afc6a1f403a2d7dde"),
    Declaration(_PUB, ID_TF, "/tf", "tf/tfMessage", "94810edda583a504dfda3829e70d7eec"),
    Declaration(_PUB, ID_ODOM, "/%s/odom", "nav_msgs/Odometry", "cd5e73d190d741a2f92e81eda573aca7"),
    Declaration(_ANS, ID_SET_ODOM_ANSWER, "/%s/set_odom", "hero_common/SetOdom", ANSWER_MD5),
    Declaration(
        _ANS, ID_MOTORS_PARAMETERS_ANSWER, "/%s/motors_parameters", "hero_common/SetMotor", ANSWER_MD5
    ),
    Declaration(
        _ANS,
        ID_POSITION_PID_PARAMETERS_ANSWER,
        "/%s/position_controller/pid_parameters",
        "hero_common/SetPID",
        ANSWER_MD5,
    ),
    Declaration(
        _ANS,
        ID_POSITION_PID_CALIBRATION_ANSWER,
        "/%s/position_controller/pid_calibration",
        "std_srvs/Trigger",
        ANSWER_MD5,
    ),
    Declaration(
        _ANS,
        ID_VELOCITY_PID_PARAMETERS_ANSWER,
        "/%s/velocity_controller/pid_parameters",
        "hero_common/SetPID",
        ANSWER_MD5,
    ),
    Declaration(
        _ANS,
        ID_VELOCITY_PID_CALIBRATION_ANSWER,
        "/%s/velocity_controller/pid_calibration",
        "std_srvs/Trigger",
        ANSWER_MD5,
    ),
    Declaration(_SUB, ID_LED, "/%s/led", "std_msgs/ColorRGBA", "a29a96539573343b1310c73607334b00"),
    # The one name that the firmware sends without a leading slash (RangeSensor.ino:79).
    Declaration(
        _SUB, ID_LASER_ENABLE, "%s/laser_enable", "std_msgs/Bool", "8b94c1b53db61fb6aed406028ad6332a"
    ),
    Declaration(
        _REQ,
        ID_IR_CALIBRATION,
        "/%s/ir_calibration",
        "hero_common/SetIRCalibration",
        "27748d949ad62e65750ad22074426005",
    ),
    Declaration(_REQ, ID_SET_ODOM, "/%s/set_odom", "hero_common/SetOdom", "938fa65709584ad8e77d238529be13b8"),
    Declaration(_SUB, ID_CMD_MOTOR, "/%s/cmd_motor", "hero_common/Motor", _MOTOR_MD5),
    Declaration(_REQ, ID_MOTORS_PARAMETERS, "/%s/motors_parameters", "hero_common/SetMotor", _MOTOR_MD5),
    Declaration(
        _SUB, ID_POSITION_CMD_VEL, "/%s/position_controller/cmd_vel", "geometry_msgs/Twist", _TWIST_MD5
    ),
    Declaration(
        _REQ,
        ID_POSITION_PID_PARAMETERS,
        "/%s/position_controller/pid_parameters",
        "hero_common/SetPID",
        _PID_MD5,
    ),
    Declaration(
        _REQ,
        ID_POSITION_PID_CALIBRATION,
        "/%s/position_controller/pid_calibration",
        "std_srvs/Trigger",
        _EMPTY_MD5,
    ),
    Declaration(
        _SUB, ID_VELOCITY_CMD_VEL, "/%s/velocity_controller/cmd_vel", "geometry_msgs/Twist", _TWIST_MD5
    ),
    Declaration(
        _REQ,
        ID_VELOCITY_PID_PARAMETERS,
        "/%s/velocity_controller/pid_parameters",
        "hero_common/SetPID",
        _PID_MD5,
    ),
    Declaration(
        _REQ,
        ID_VELOCITY_PID_CALIBRATION,
        "/%s/velocity_controller/pid_calibration",
        "std_srvs/Trigger",
        _EMPTY_MD5,
    ),
)


def encode_declarations(name: str) -> bytes:
    """Return the frames with which the robot called name (hero_N) declares everything, in one burst."""
    parts: List[bytes] = []
    for entry in DECLARATIONS:
        info = payloads.TopicInfo(
            entry.topic_id, entry.name.replace("%s", name), entry.message_type, entry.md5sum, BUFFER_LENGTH
        )
        parts.append(packets.encode_packet(entry.kind, payloads.encode_topic_info(info)))
    return b"".join(parts)
