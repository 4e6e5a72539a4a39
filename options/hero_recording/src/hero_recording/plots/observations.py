"""Collects what a recording tells of each robot into arrays. Pure: messages are read by their fields.

Times are the recorder's, seconds since 1970; stamps are the robot's clock, which the driver synchronizes.
"""

import math
from array import array
from collections import defaultdict
from typing import Any, DefaultDict, Iterable, List, NamedTuple, Optional, Set, Tuple

import numpy as np

from hero_node import pose_of, yaw_of

from ..bags.tables import TABLES, Row, read_rows
from ..bags.topics import (
    STATIC_TRANSFORMS_TOPIC,
    TRANSFORMS_TYPES,
    Message,
    find_robot_topic,
    is_arena_topic,
    is_fleet_topic,
)

KINDS = ("odometry", "ground_truth", "pose", "velocity_command", "position_command")
CUBE, CYLINDER = 1, 3
"""Types of visualization_msgs/Marker that walls and round obstacles are drawn with."""

MAX_VALUE = 1e6


class Series:
    """Rows of numbers, compactly: first times, then values.

    Attributes:
        skipped: rows that were refused because a value is not finite, or beyond what a robot can measure.
    """

    def __init__(self, times: int, values: int) -> None:
        """Start empty; times and values are the numbers of columns."""
        self.skipped = 0
        self._times = times
        self._width = times + values
        self._numbers = array("d")

    def __len__(self) -> int:
        return len(self._numbers) // self._width

    def add(self, *row: float) -> None:
        """Add a row, unless a value is absurd: a single one would set the scale of a whole figure."""
        if all(abs(value) <= MAX_VALUE for value in row[self._times :]):
            self._numbers.extend(row)
        else:
            self.skipped += 1

    def columns(self) -> np.ndarray:
        """Return the numbers (columns, rows); add() must not follow."""
        numbers = np.frombuffer(self._numbers) if self._numbers else np.zeros(0)
        return numbers.reshape(-1, self._width).T


class Origin(NamedTuple):
    """Pose of a robot's odom frame from time_s on."""

    time_s: float
    x_m: float
    y_m: float
    yaw_rad: float


class RobotObservations:
    """The recorded data of one robot.

    Attributes:
        odometry, ground_truth: rows of arrival s, stamp s, x m, y m, yaw rad, linear m/s, angular rad/s.
        poses: rows of arrival s, stamp s, x m, y m, yaw rad, by localization.
        commands: rows of arrival s, linear m/s, angular rad/s, of both controllers.
        origins: poses of its odom frame in the frame that all robots share.
        reconnects: so far, as its driver reported it last; None without a report.
    """

    def __init__(self) -> None:
        self.odometry = Series(2, 5)
        self.ground_truth = Series(2, 5)
        self.poses = Series(2, 3)
        self.commands = Series(1, 2)
        self.origins: List[Origin] = []
        self.reconnects: Optional[int] = None

    def add(self, kind: str, row: Row) -> None:
        """Store a row of a table."""
        if kind == "status":
            self.reconnects = dict(zip(TABLES["status"], row[1:]))["reconnects"]
        elif kind == "pose":
            self.poses.add(*row[:5])
        else:
            series = {"odometry": self.odometry, "ground_truth": self.ground_truth}.get(kind, self.commands)
            series.add(*row)

    @property
    def skipped(self) -> int:
        """Number of messages with absurd numbers."""
        return sum(series.skipped for series in (self.odometry, self.ground_truth, self.poses, self.commands))


class Observations:
    """The recorded data of all robots.

    Attributes:
        robots: by id.
        walls_m: segments x1 y1 x2 y2 of the arena.
        circles_m: round obstacles x y radius.
        shared_frame: frame of the origins; empty if none were recorded.
        pose_frame, true_frame: frames of poses and ground truth; empty if none were recorded.
    """

    def __init__(self, robot_ids: Optional[Set[int]] = None) -> None:
        """Start empty; robot_ids None: all robots."""
        self._robot_ids = robot_ids
        self.robots: DefaultDict[int, RobotObservations] = defaultdict(RobotObservations)
        self.walls_m: List[Tuple[float, float, float, float]] = []
        self.circles_m: List[Tuple[float, float, float]] = []
        self.shared_frame = self.pose_frame = self.true_frame = ""

    def wants(self, topic: str, message_type: str) -> bool:
        """Return whether receive() uses a topic."""
        found = find_robot_topic(topic, message_type)
        if found is not None:
            robot_id, kind = found
            return kind in KINDS and self._wants_robot(robot_id)
        return (
            is_fleet_topic(topic, message_type)
            or (topic == STATIC_TRANSFORMS_TOPIC and message_type in TRANSFORMS_TYPES)
            or is_arena_topic(topic, message_type)
        )

    def _wants_robot(self, robot_id: int) -> bool:
        return self._robot_ids is None or robot_id in self._robot_ids

    def receive(self, message: Message) -> None:
        """Store a message of a topic that wants() accepts."""
        if message.topic == STATIC_TRANSFORMS_TOPIC:
            self._receive_transforms(message)
        elif is_arena_topic(message.topic, message.type):
            self._receive_arena(message.content.markers)
        else:
            for robot_id, kind, row in read_rows(*message):
                if self._wants_robot(robot_id):
                    self.robots[robot_id].add(kind, row)
                    if kind == "pose":
                        self.pose_frame = message.content.header.frame_id.strip("/")
                    elif kind == "ground_truth":
                        self.true_frame = message.content.header.frame_id.strip("/")

    def _receive_transforms(self, message: Message) -> None:
        for transform in message.content.transforms:
            name, _, frame = transform.child_frame_id.strip("/").rpartition("/")
            number = name[len("hero_") :] if name.startswith("hero_") else ""
            if frame != "odom" or not number.isdecimal() or not self._wants_robot(int(number)):
                continue
            self.shared_frame = transform.header.frame_id.strip("/")
            found = transform.transform
            origin = Origin(message.time_s, *pose_of(found.translation, found.rotation))
            if not all(map(math.isfinite, origin)):
                continue
            origins = self.robots[int(number)].origins
            # Latched messages are recorded again at the start of every file of a split.
            if not origins or origins[-1][1:] != origin[1:]:
                origins.append(origin)

    def _receive_arena(self, markers: Iterable[Any]) -> None:
        self.walls_m, self.circles_m = [], []
        for marker in markers:
            x_m, y_m = marker.pose.position.x, marker.pose.position.y
            if marker.type == CUBE:
                yaw_rad = yaw_of(marker.pose.orientation)
                half_x_m = math.cos(yaw_rad) * marker.scale.x / 2.0
                half_y_m = math.sin(yaw_rad) * marker.scale.x / 2.0
                self.walls_m.append((x_m - half_x_m, y_m - half_y_m, x_m + half_x_m, y_m + half_y_m))
            elif marker.type == CYLINDER:
                self.circles_m.append((x_m, y_m, marker.scale.x / 2.0))
