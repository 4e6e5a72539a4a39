"""Identities of robots and the names that they may use: those within /hero_N. Pure."""

import re
from typing import NamedTuple, Optional

_ROBOT_NAME = re.compile(r"/?hero_(0|[1-9][0-9]{0,5})/.")

TF_TOPICS = frozenset(("/tf", "tf"))

DRIVER_TYPES = frozenset(("hero_msgs/RobotArray", "hero_common/RobotArray"))
"""By this type programs find drivers."""

RESERVED = "only drivers may use this name or type"

NOT_FROM_ROBOTS = frozenset(
    (
        *("measured_pose", "pose", "ground_truth", "neighbors"),  # localization, simulators, hero_swarm
        *("odom_raw", "proximity", "range"),  # this driver, from what the robot sends
        *("cmd_vel", "velocity_controller/cmd_vel", "position_controller/cmd_vel", "cmd_motor"),  # programs
        *("goal", "go_to/goal", "go_to/cancel", "go_to/status", "go_to/feedback", "go_to/result"),
    )
)
"""Topics of a robot that others publish: one that sent them itself would move in the map, or drive by itself."""


class Identity(NamedTuple):
    """Which robot a connection belongs to."""

    namespace: str  # e.g. "/hero_3"
    number: int


def identify(topic_name: str) -> Optional[Identity]:
    """Return the HeRo that a topic name belongs to, None if it belongs to none."""
    match = _ROBOT_NAME.match(topic_name)
    return None if match is None else Identity("/hero_" + match[1], int(match[1]))


def resolve(topic_name: str, identity: Identity) -> Optional[str]:
    """Return the ROS name for topic_name, slash or not (RangeSensor.ino:79), None if the HeRo may not use it."""
    if topic_name in TF_TOPICS:
        return "/tf"
    name = topic_name if topic_name.startswith("/") else "/" + topic_name
    return name if name.startswith(identity.namespace + "/") else None


def find_refusal(
    topic_name: str, message_type: str, identity: Identity, node: str, is_from_robot: bool
) -> Optional[str]:
    """Return why the HeRo identity may not declare a topic or service to the driver called node, None if it may."""
    name = resolve(topic_name, identity)
    if name is None:
        return f"outside {identity.namespace}"
    if message_type in DRIVER_TYPES or name == node or name.startswith(node + "/"):
        return RESERVED
    if is_from_robot and name[len(identity.namespace) + 1 :] in NOT_FROM_ROBOTS:
        return "robots do not send it, other programs do; rename it in the firmware"
    return None
