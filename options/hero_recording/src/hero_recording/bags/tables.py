"""The tables of an export: where the value of each column is found in a message. Pure.

Every table begins with time_s, when the recorder received the message; stamp_s is when the robot measured it, both in
seconds since 1970. The columns are explained in docs/recording.md.
"""

import math
import re
from operator import attrgetter
from typing import Any, Callable, Dict, Iterable, List, Tuple

from hero_client.values import STATES
from hero_node import yaw_of
from hero_node.files import ExtraTopic
from hero_node.robot_constants import BEAM_NAMES

from .topics import declare_topics, find_robot_topic, is_fleet_topic

Row = Tuple[Any, ...]
Columns = Dict[str, Callable[[Any], Any]]
"""Name of each column after time_s, and the function that reads its value from a message."""


def to_seconds(stamp: Any) -> float:
    """Return a stamp of a message in s."""
    # rosbags decodes what was recorded under ROS 1 with the names of ROS 2.
    return stamp.sec + stamp.nanosec / 1e9 if hasattr(stamp, "nanosec") else float(stamp.to_sec())


def _read_stamp(content: Any) -> float:
    return to_seconds(content.header.stamp)


def _range_reader(index: int) -> Callable[[Any], Any]:
    return lambda content: content.ranges[index] if index < len(content.ranges) else math.nan


_PLACE: Columns = {
    "stamp_s": _read_stamp,
    "x_m": attrgetter("pose.pose.position.x"),
    "y_m": attrgetter("pose.pose.position.y"),
    "yaw_rad": lambda content: yaw_of(content.pose.pose.orientation),
}
_ODOMETRY: Columns = {
    **_PLACE,
    "linear_m_s": attrgetter("twist.twist.linear.x"),
    "angular_rad_s": attrgetter("twist.twist.angular.z"),
}
_TWIST: Columns = {"linear_m_s": attrgetter("linear.x"), "angular_rad_s": attrgetter("angular.z")}

TABLES: Dict[str, Columns] = {
    "odometry": _ODOMETRY,
    "ground_truth": _ODOMETRY,
    "pose": {
        **_PLACE,
        # Of x, y and yaw in the covariance of x, y, z and rotations about x, y, z.
        "x_sd_m": lambda content: math.sqrt(abs(content.pose.covariance[0])),
        "y_sd_m": lambda content: math.sqrt(abs(content.pose.covariance[7])),
        "yaw_sd_rad": lambda content: math.sqrt(abs(content.pose.covariance[35])),
    },
    "encoder": {
        "stamp_s": _read_stamp,
        "left_ticks": attrgetter("left_ticks"),
        "right_ticks": attrgetter("right_ticks"),
        "left_speed_m_s": attrgetter("left_speed"),
        "right_speed_m_s": attrgetter("right_speed"),
        "left_speed_filtered_m_s": attrgetter("left_speed_filtered"),
        "right_speed_filtered_m_s": attrgetter("right_speed_filtered"),
    },
    "proximity": {
        "stamp_s": _read_stamp,
        **{f"{name.replace(' ', '_')}_m": _range_reader(index) for index, name in enumerate(BEAM_NAMES)},
    },
    "range": {"stamp_s": _read_stamp, "range_m": attrgetter("range")},
    "velocity_command": _TWIST,
    "position_command": _TWIST,
    "motor_command": {"left_us": attrgetter("left_motor_pwm"), "right_us": attrgetter("right_motor_pwm")},
    "led": {"red": attrgetter("r"), "green": attrgetter("g"), "blue": attrgetter("b"), "alpha": attrgetter("a")},
    "imu": {
        "stamp_s": _read_stamp,
        **{"orientation_" + axis: attrgetter("orientation." + axis) for axis in "xyzw"},
        **{"angular_raw_" + axis: attrgetter("angular_velocity." + axis) for axis in "xyz"},
        **{"acceleration_raw_" + axis: attrgetter("linear_acceleration." + axis) for axis in "xyz"},
    },
    # The driver's report on a robot, once a second and at every change.
    "status": {
        "state": lambda robot: STATES.get(robot.state, str(robot.state)).lower(),
        "address": attrgetter("address"),
        "packets_per_s": attrgetter("packets_per_s"),
        "bytes_per_s": attrgetter("bytes_per_s"),
        "clock_offset_s": attrgetter("clock_offset"),
        "reconnects": attrgetter("reconnects"),
        "dropped_messages": attrgetter("dropped_messages"),
        "bad_packets": attrgetter("bad_packets"),
        "last_error": attrgetter("last_error"),
    },
}
"""By kind, which is also the name of the file."""


def declare_tables(topics: Iterable[ExtraTopic]) -> None:
    """Add a table for each topic that fleet.yaml declares, with its value as a column."""
    declare_topics(topics)
    for topic in topics:
        column = "_".join(filter(None, (topic.name, re.sub(r"\W+", "_", topic.unit))))
        TABLES[topic.name] = {column: attrgetter(topic.field)}


def is_exported(topic: str, message_type: str) -> bool:
    """Return whether read_rows() makes rows of a topic."""
    return find_robot_topic(topic, message_type) is not None or is_fleet_topic(topic, message_type)


def read_rows(topic: str, message_type: str, content: Any, time_s: float) -> List[Tuple[int, str, Row]]:
    """Return the rows that a message adds, each with the id of the robot and the kind of the table."""
    found = find_robot_topic(topic, message_type)
    if found is None:
        sources = [(robot.id, "status", robot) for robot in content.robots if robot.id >= 0]
    else:
        sources = [(*found, content)]
    return [
        (robot_id, kind, (time_s, *(read(source) for read in TABLES[kind].values())))
        for robot_id, kind, source in sources
    ]
