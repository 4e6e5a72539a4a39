"""Topics and services of a robot, in the order in which its firmware creates them, and the packets that declare them.

Pure. Source: TopicInfo packets of the stock robot (firmware v3.8). Ids are given in that order: to what the robot sends
from 125 on, to what it receives from 100 on (ros.h of the firmware).
"""

import itertools
from typing import Dict, NamedTuple, Optional, Sequence, Tuple

from hero_driver.rosserial import packets, payloads
from hero_node.ros_messages import MD5SUMS

BUFFER_LENGTH = 4096
"""INPUT_SIZE and OUTPUT_SIZE of the firmware's NodeHandle."""

FIRST_SENT_ID = packets.FIRST_TOPIC_ID + 25
"""Below it are the 25 slots of subscribers: ids of empty ones are ignored, others read outside the robot's table."""

_ANSWER_MD5 = "937c9679a518e3a18d831e57125ea522"
"""The response of every service of the robot: bool success, string message."""

PUB = (packets.ID_PUBLISHER, None)
SUB = (None, packets.ID_SUBSCRIBER)
SERVICE = (packets.ID_SERVICE_SERVER_PUBLISHER, packets.ID_SERVICE_SERVER_SUBSCRIBER)
"""Ids of the packets that declare what is sent (the responses of a service), and what is received (its requests)."""


class Topic(NamedTuple):
    """A topic or service.

    Attributes:
        kinds: PUB, SUB or SERVICE.
        name: as it is declared; %s stands for hero_N.
        md5sum: of the message, or of the request.
    """

    kinds: Tuple[Optional[int], Optional[int]]
    name: str
    message_type: str
    md5sum: str

    @property
    def key(self) -> str:
        """The name without the robot's."""
        return self.name.rpartition("%s")[2].lstrip("/")


STOCK_TOPICS = (
    Topic(PUB, "/%s/laser", "sensor_msgs/LaserScan", MD5SUMS["sensor_msgs/LaserScan"]),
    Topic(SUB, "/%s/led", "std_msgs/ColorRGBA", "a29a96539573343b1310c73607334b00"),
    # The one name that the firmware sends without a leading slash (RangeSensor.ino:79).
    Topic(SUB, "%s/laser_enable", "std_msgs/Bool", "8b94c1b53db61fb6aed406028ad6332a"),
    Topic(SERVICE, "/%s/ir_calibration", "hero_common/SetIRCalibration", "27748d949ad62e65750ad22074426005"),
    Topic(PUB, "/%s/imu", "sensor_msgs/Imu", MD5SUMS["sensor_msgs/Imu"]),
    Topic(PUB, "/%s/encoder", "hero_common/Encoder", MD5SUMS["hero_msgs/Encoder"]),
    Topic(PUB, "/tf", "tf/tfMessage", MD5SUMS["tf2_msgs/TFMessage"]),
    Topic(PUB, "/%s/odom", "nav_msgs/Odometry", MD5SUMS["nav_msgs/Odometry"]),
    Topic(SERVICE, "/%s/set_odom", "hero_common/SetOdom", "938fa65709584ad8e77d238529be13b8"),
    Topic(SUB, "/%s/cmd_motor", "hero_common/Motor", MD5SUMS["hero_msgs/Motor"]),
    Topic(SERVICE, "/%s/motors_parameters", "hero_common/SetMotor", MD5SUMS["hero_msgs/Motor"]),  # the same fields
    *(
        topic
        for controller in ("/%s/position_controller/", "/%s/velocity_controller/")
        for topic in (
            Topic(SUB, controller + "cmd_vel", "geometry_msgs/Twist", MD5SUMS["geometry_msgs/Twist"]),
            Topic(SERVICE, controller + "pid_parameters", "hero_common/SetPID", "f0d0bdba02bc62a48d52638e38dc8a4b"),
            Topic(SERVICE, controller + "pid_calibration", "std_srvs/Trigger", "d41d8cd98f00b204e9800998ecf8427e"),
        )
    ),
)


def assign_ids(topics: Sequence[Topic]) -> Tuple[Dict[str, int], Dict[str, int]]:
    """Return the ids of what a robot with these topics sends, and of what it receives, by the topics' keys."""
    sent, received = ([topic.key for topic in topics if topic.kinds[side] is not None] for side in range(2))
    return dict(zip(sent, itertools.count(FIRST_SENT_ID))), dict(zip(received, itertools.count(packets.FIRST_TOPIC_ID)))


def encode_declarations(name: str, topics: Sequence[Topic]) -> bytes:
    """Return the packets with which the robot called name (hero_N) declares topics, in one burst."""
    burst = b""
    for side, ids in enumerate(assign_ids(topics)):
        for topic in topics:
            kind = topic.kinds[side]
            if kind is not None:
                md5sum = _ANSWER_MD5 if kind == packets.ID_SERVICE_SERVER_PUBLISHER else topic.md5sum
                texts = topic.name.replace("%s", name), topic.message_type, md5sum
                info = payloads.TopicInfo(ids[topic.key], *texts, BUFFER_LENGTH)
                burst += packets.encode_packet(kind, payloads.encode_topic_info(info))
    return burst
