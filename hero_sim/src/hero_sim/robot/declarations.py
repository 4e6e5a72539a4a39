"""Declarations of one robot: its topics and services in the stock order, with the stock ids.

Pure. Source: TopicInfo packets of the stock robot (firmware v3.8); ids are given in call order, publishers
from 125 (100 + 25 subscriber slots) and subscribers from 100 (ros.h of the firmware).
"""

from typing import Optional, Sequence, Tuple

from hero_driver.rosserial import packets, payloads

BUFFER_LENGTH = 4096
"""INPUT_SIZE and OUTPUT_SIZE of the firmware's NodeHandle."""

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

_ANSWER_MD5 = "937c9679a518e3a18d831e57125ea522"
"""The response of every service of the robot: bool success, string message."""

_TYPES = {
    # md5sums of the messages, and of the requests of services
    "sensor_msgs/LaserScan": "90c7ef2dc6895d81024acba2ac42f369",
    "std_msgs/Float32": "73fcbf46b49191e672908e50842a83d4",
    "sensor_msgs/Imu": "6a62c6daae103f4ff57a132d6f95cec2",
    "hero_common/Encoder": "b5586cdbae9b740afc6a1f403a2d7dde",
    "tf/tfMessage": "94810edda583a504dfda3829e70d7eec",
    "nav_msgs/Odometry": "cd5e73d190d741a2f92e81eda573aca7",
    "std_msgs/ColorRGBA": "a29a96539573343b1310c73607334b00",
    "std_msgs/Bool": "8b94c1b53db61fb6aed406028ad6332a",
    "hero_common/Motor": "44d4249d207ce6a89de3d72080e4d0b5",
    "geometry_msgs/Twist": "9f195f881246fdfa2798d1d3eebca84a",
    "hero_common/SetIRCalibration": "27748d949ad62e65750ad22074426005",
    "hero_common/SetOdom": "938fa65709584ad8e77d238529be13b8",
    "hero_common/SetMotor": "44d4249d207ce6a89de3d72080e4d0b5",
    "hero_common/SetPID": "f0d0bdba02bc62a48d52638e38dc8a4b",
    "std_srvs/Trigger": "d41d8cd98f00b204e9800998ecf8427e",
}

PUB = packets.ID_PUBLISHER
SUB = packets.ID_SUBSCRIBER
ANS = packets.ID_SERVICE_SERVER_PUBLISHER
REQ = packets.ID_SERVICE_SERVER_SUBSCRIBER

Declaration = Tuple[int, int, str, str]

DECLARATIONS: Tuple[Declaration, ...] = (
    # id of the packet that declares it, id, name (%s: hero_N), type
    (PUB, ID_LASER, "/%s/laser", "sensor_msgs/LaserScan"),
    (ANS, ID_IR_CALIBRATION_ANSWER, "/%s/ir_calibration", "hero_common/SetIRCalibration"),
    (PUB, ID_IMU, "/%s/imu", "sensor_msgs/Imu"),
    (PUB, ID_ENCODER, "/%s/encoder", "hero_common/Encoder"),
    (PUB, ID_TF, "/tf", "tf/tfMessage"),
    (PUB, ID_ODOM, "/%s/odom", "nav_msgs/Odometry"),
    (ANS, ID_SET_ODOM_ANSWER, "/%s/set_odom", "hero_common/SetOdom"),
    (ANS, ID_MOTORS_PARAMETERS_ANSWER, "/%s/motors_parameters", "hero_common/SetMotor"),
    (ANS, ID_POSITION_PID_PARAMETERS_ANSWER, "/%s/position_controller/pid_parameters", "hero_common/SetPID"),
    (ANS, ID_POSITION_PID_CALIBRATION_ANSWER, "/%s/position_controller/pid_calibration", "std_srvs/Trigger"),
    (ANS, ID_VELOCITY_PID_PARAMETERS_ANSWER, "/%s/velocity_controller/pid_parameters", "hero_common/SetPID"),
    (ANS, ID_VELOCITY_PID_CALIBRATION_ANSWER, "/%s/velocity_controller/pid_calibration", "std_srvs/Trigger"),
    (SUB, ID_LED, "/%s/led", "std_msgs/ColorRGBA"),
    # The one name that the firmware sends without a leading slash (RangeSensor.ino:79).
    (SUB, ID_LASER_ENABLE, "%s/laser_enable", "std_msgs/Bool"),
    (REQ, ID_IR_CALIBRATION, "/%s/ir_calibration", "hero_common/SetIRCalibration"),
    (REQ, ID_SET_ODOM, "/%s/set_odom", "hero_common/SetOdom"),
    (SUB, ID_CMD_MOTOR, "/%s/cmd_motor", "hero_common/Motor"),
    (REQ, ID_MOTORS_PARAMETERS, "/%s/motors_parameters", "hero_common/SetMotor"),
    (SUB, ID_POSITION_CMD_VEL, "/%s/position_controller/cmd_vel", "geometry_msgs/Twist"),
    (REQ, ID_POSITION_PID_PARAMETERS, "/%s/position_controller/pid_parameters", "hero_common/SetPID"),
    (REQ, ID_POSITION_PID_CALIBRATION, "/%s/position_controller/pid_calibration", "std_srvs/Trigger"),
    (SUB, ID_VELOCITY_CMD_VEL, "/%s/velocity_controller/cmd_vel", "geometry_msgs/Twist"),
    (REQ, ID_VELOCITY_PID_PARAMETERS, "/%s/velocity_controller/pid_parameters", "hero_common/SetPID"),
    (REQ, ID_VELOCITY_PID_CALIBRATION, "/%s/velocity_controller/pid_calibration", "std_srvs/Trigger"),
)


ANSWER_IDS = {
    request: answer
    for kind, answer, service, _ in DECLARATIONS if kind == ANS
    for other, request, name, _ in DECLARATIONS if (other, name) == (REQ, service)
}  # fmt: skip
"""Ids of the responses of services, by those of their requests."""


def find_type(topic_id: int) -> str:
    """Return the type of a declared topic or service."""
    return next(message_type for _, declared_id, _, message_type in DECLARATIONS if declared_id == topic_id)


def encode_entries(name: str, entries: Sequence[Declaration], encoder_md5: Optional[str] = None) -> bytes:
    """Return the packets that declare entries for the robot called name; encoder_md5: of another model's Encoder."""
    burst = b""
    for kind, topic_id, pattern, message_type in entries:
        md5sum = _ANSWER_MD5 if kind == ANS else _TYPES[message_type]
        if encoder_md5 is not None and message_type == "hero_common/Encoder":
            md5sum = encoder_md5
        info = payloads.TopicInfo(topic_id, pattern.replace("%s", name), message_type, md5sum, BUFFER_LENGTH)
        burst += packets.encode_packet(kind, payloads.encode_topic_info(info))
    return burst
