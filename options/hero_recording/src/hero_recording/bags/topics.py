"""The topics that are recorded, and what each of them holds. Pure.

The patterns are regular expressions: robots that join later are recorded too.
"""

import re
from typing import Any, Iterable, List, NamedTuple, Optional, Sequence, Tuple

from hero_node.files import ExtraTopic

ROBOT_TOPICS = {
    "odom": ("odometry", "nav_msgs/Odometry"),
    "ground_truth": ("ground_truth", "nav_msgs/Odometry"),
    "pose": ("pose", "geometry_msgs/PoseWithCovarianceStamped"),
    "encoder": ("encoder", "hero_msgs/Encoder"),
    "proximity": ("proximity", "sensor_msgs/LaserScan"),
    "range": ("range", "sensor_msgs/Range"),
    "cmd_vel": ("velocity_command", "geometry_msgs/Twist"),
    "velocity_controller/cmd_vel": ("velocity_command", "geometry_msgs/Twist"),
    "position_controller/cmd_vel": ("position_command", "geometry_msgs/Twist"),
    "cmd_motor": ("motor_command", "hero_msgs/Motor"),
    "led": ("led", "std_msgs/ColorRGBA"),
    "imu": ("imu", "sensor_msgs/Imu"),
}
"""Below /hero_N/: kind, which names the table, and type; a topic of another type belongs to another program."""


def declare_topics(topics: Iterable[ExtraTopic]) -> None:
    """Record topics that fleet.yaml declares, too, and export their messages."""
    ROBOT_TOPICS.update((topic.topic, (topic.name, topic.type)) for topic in topics)


FLEET_TYPE = "hero_msgs/RobotArray"
STATIC_TRANSFORMS_TOPIC = "/tf_static"
TRANSFORMS_TYPES = ("tf2_msgs/TFMessage", "tf/tfMessage")
MARKERS_TYPE = "visualization_msgs/MarkerArray"

SHARED_PATTERNS = (
    "/tf",
    "/tf_static",
    "/rosout",
    "/diagnostics",
    "/hero_driver[^/]*/(robots|stopped)",
    "/(.*/)?arena",
    "/localization/poses",
    "/track/(measured_poses|objects)",
    "/map",
)
"""Topics of no single robot: frames, log lines, the robots of all drivers (docs/several_machines.md), walls,
what hero_localization publishes of all robots."""

_FLEET_TOPIC = re.compile(r"/hero_driver[^/]*/robots")
_ROBOT_TOPIC = re.compile(r"/hero_([0-9]{1,9})/(.+)")


class Message(NamedTuple):
    """A message as it was recorded."""

    topic: str
    type: str
    content: Any
    time_s: float
    """When the recorder received it, since 1970."""


def make_patterns(robot_ids: Optional[Sequence[int]], extra: Sequence[str]) -> List[str]:
    """Return the regular expressions of the topics to record; robot_ids None: all robots, including later ones."""
    robots = r"[0-9]+" if robot_ids is None else f"({'|'.join(map(str, robot_ids))})"
    return [f"/hero_{robots}/({'|'.join(ROBOT_TOPICS)})", *SHARED_PATTERNS, *extra]


def find_robot_topic(topic: str, message_type: str) -> Optional[Tuple[int, str]]:
    """Return the id of the robot and the kind of a topic; None if it is no robot's, or of another type."""
    match = _ROBOT_TOPIC.fullmatch(topic)
    if match is None:
        return None
    kind, expected_type = ROBOT_TOPICS.get(match.group(2), ("", ""))
    return (int(match.group(1)), kind) if kind and message_type == expected_type else None


def is_fleet_topic(topic: str, message_type: str) -> bool:
    """Return whether a topic lists the robots of a driver."""
    return message_type == FLEET_TYPE and _FLEET_TOPIC.fullmatch(topic) is not None


def is_arena_topic(topic: str, message_type: str) -> bool:
    """Return whether a topic holds the walls and obstacles of an arena."""
    return message_type == MARKERS_TYPE and topic.split("/")[-1] == "arena"
