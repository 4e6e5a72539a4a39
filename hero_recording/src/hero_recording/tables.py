"""Messages of a recording -> rows of one table per robot and kind, columns with units. Pure.

Every table begins with time_s, when the recorder got the message; stamp_s is when the robot measured it, by its own
clock, which the driver keeps in step. Both are seconds since 1970. Frames and units are those of the topics:
docs/robot_interface.md.
"""

import math
from typing import Any, Callable, Dict, List, NamedTuple, Tuple

from . import topics
from .observations import STATE_NAMES, yaw_of

Row = Tuple[Any, ...]

STATUS = "status"
"""What the driver says of a robot, once a second and at every change."""

TEXT, NUMBER = "text", "number"

BEAMS = ("behind", "behind_right", "right", "ahead_right", "ahead", "ahead_left", "left", "behind_left")
"""Of /hero_N/proximity by index: counter-clockwise from straight behind."""


class Column(NamedTuple):
    """A column of a table: name with unit, what it holds, the unit alone, and what it means."""

    name: str
    kind: str
    unit: str
    meaning: str


class Table(NamedTuple):
    """A kind of table: its columns, and what makes a row of a message's content (without time_s)."""

    columns: Tuple[Column, ...]
    read: Callable[[Any], Row]


def _number(name: str, unit: str, meaning: str) -> Column:
    return Column(name, NUMBER, unit, meaning)


TIME = _number("time_s", "s", "when the recorder got it, since 1970")
_STAMP = _number("stamp_s", "s", "when it was measured, since 1970")

_POSE = (
    TIME,
    _STAMP,
    _number("x_m", "m", "position"),
    _number("y_m", "m", "position"),
    _number("yaw_rad", "rad", "heading, counter-clockwise, -pi to pi"),
    _number("linear_m_s", "m/s", "speed ahead"),
    _number("turn_rad_s", "rad/s", "turn to the left"),
)
_COMMAND = (
    TIME,
    _number("linear_m_s", "m/s", "speed ahead"),
    _number("turn_rad_s", "rad/s", "turn to the left"),
)
_ENCODER_FIELDS = (
    ("left_ticks", "", "since boot or the last set_odom, 288 per turn of the wheel"),
    ("right_ticks", "", "as left_ticks"),
    ("left_speed", "m/s", "of the wheel's rim, unfiltered"),
    ("right_speed", "m/s", "as left_speed"),
    ("left_speed_filtered", "m/s", "of the wheel's rim, filtered by the robot"),
    ("right_speed_filtered", "m/s", "as left_speed_filtered"),
)


def _stamp_of(content: Any) -> float:
    return float(content.header.stamp.to_sec())


def _read_pose(content: Any) -> Row:
    pose, twist = content.pose.pose, content.twist.twist
    place = pose.position
    return (_stamp_of(content), place.x, place.y, yaw_of(pose.orientation), twist.linear.x, twist.angular.z)


def _read_command(content: Any) -> Row:
    return (content.linear.x, content.angular.z)


def _read_imu(content: Any) -> Row:
    turn, acceleration = content.angular_velocity, content.linear_acceleration
    quaternion = content.orientation
    return (
        _stamp_of(content),
        *(quaternion.x, quaternion.y, quaternion.z, quaternion.w),
        *(turn.x, turn.y, turn.z),
        *(acceleration.x, acceleration.y, acceleration.z),
    )


TABLES: Dict[str, Table] = {
    topics.ODOMETRY: Table(_POSE, _read_pose),
    topics.GROUND_TRUTH: Table(_POSE, _read_pose),
    topics.ENCODER: Table(
        (
            TIME,
            _STAMP,
            *(
                _number(name + ("_m_s" if unit else ""), unit or "ticks", meaning)
                for name, unit, meaning in _ENCODER_FIELDS
            ),
        ),
        lambda content: (_stamp_of(content), *(getattr(content, name) for name, _, _ in _ENCODER_FIELDS)),
    ),
    topics.PROXIMITY: Table(
        (
            TIME,
            _STAMP,
            *(
                _number(
                    beam + "_m",
                    "m",
                    "from the robot's centre; inf: nothing, -inf: too close, nan: not calibrated",
                )
                for beam in BEAMS
            ),
        ),
        lambda content: (_stamp_of(content), *(*content.ranges, *[math.nan] * len(BEAMS))[: len(BEAMS)]),
    ),
    topics.VELOCITY_COMMAND: Table(_COMMAND, _read_command),
    topics.POSITION_COMMAND: Table(_COMMAND, _read_command),
    topics.MOTOR_COMMAND: Table(
        (TIME, _number("left_us", "us", "servo pulse"), _number("right_us", "us", "servo pulse")),
        lambda content: (content.left_motor_pwm, content.right_motor_pwm),
    ),
    topics.LED: Table(
        (TIME, *(_number(name, "1", "0 to 1") for name in ("red", "green", "blue", "alpha"))),
        lambda content: (content.r, content.g, content.b, content.a),
    ),
    topics.IMU: Table(
        (
            TIME,
            _STAMP,
            *(_number("orientation_" + axis, "1", "quaternion") for axis in "xyzw"),
            *(
                _number("turn_raw_%s" % axis, "counts", "as the robot sends it, not calibrated")
                for axis in "xyz"
            ),
            *(
                _number("acceleration_raw_%s" % axis, "1000 counts", "as the robot sends it; 8.192 is 1 g")
                for axis in "xyz"
            ),
        ),
        _read_imu,
    ),
    STATUS: Table(
        (
            TIME,
            Column("state", TEXT, "", "joining, ready, away or refused"),
            Column("address", TEXT, "", "host:port of the robot"),
            _number("packets_per_s", "1/s", "from the robot, mean of the last second"),
            _number("bytes_per_s", "bytes/s", "from the robot, mean of the last second"),
            _number("clock_offset_s", "s", "stamp minus arrival, median of the last second"),
            _number("reconnects", "1", "since the driver began"),
            _number("dropped_messages", "1", "since the driver began"),
            _number("bad_packets", "1", "since the driver began"),
            Column("last_error", TEXT, "", "empty if there was none"),
        ),
        lambda robot: (
            STATE_NAMES.get(robot.state, str(robot.state)),
            robot.address,
            robot.packets_per_s,
            robot.bytes_per_s,
            robot.clock_offset,
            robot.reconnects,
            robot.dropped_messages,
            robot.bad_packets,
            robot.last_error,
        ),
    ),
}
"""By kind, which is also the file's name."""


class RobotRow(NamedTuple):
    """A row for a table of one robot."""

    robot_id: int
    kind: str
    row: Row


def wants(topic: str, message_type: str) -> bool:
    """Return whether read_rows() makes rows of a topic."""
    return topics.find_robot_topic(topic, message_type) is not None or topics.is_fleet_topic(
        topic, message_type
    )


def read_rows(topic: str, message_type: str, content: Any, time_s: float) -> List[RobotRow]:
    """Return the rows that a message is worth."""
    found = topics.find_robot_topic(topic, message_type)
    if found is not None:
        return [RobotRow(found.robot_id, found.kind, (time_s, *TABLES[found.kind].read(content)))]
    return [
        RobotRow(robot.id, STATUS, (time_s, *TABLES[STATUS].read(robot)))
        for robot in content.robots
        if robot.id >= 0
    ]
