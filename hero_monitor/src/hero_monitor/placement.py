"""Converts between poses in hero_N/odom and poses on the map. Pure.

A robot knows only its pose in hero_N/odom. The simulator or a tracking system publishes on /tf_static where that frame
lies on the map. Robots without such a transform are drawn side by side, and the page says so.
"""

import math
from typing import Dict, Iterable, List

from hero_client.geometry import Pose

APART_M = 1.0
"""Between the origins of robots without a map transform: farther than a short drive."""

NOWHERE = Pose(0.0, 0.0, 0.0)


class Placement:
    """The odometry frames of all robots on the map."""

    def __init__(self, map_frame: str) -> None:
        self._map_frame = map_frame.lstrip("/")
        self._known: Dict[str, Pose] = {}
        self._assumed: Dict[str, Pose] = {}

    def receive_transform(self, parent: str, child: str, pose: Pose) -> None:
        """Take one transform; all but those from the map's frame to an odometry frame are ignored."""
        robot, _, frame = child.lstrip("/").rpartition("/")
        if parent.lstrip("/") == self._map_frame and frame == "odom" and robot:
            self._known[robot] = pose

    def knows(self, robot: str) -> bool:
        """Return whether a robot's odometry frame has a map transform."""
        return robot in self._known

    def set_robots(self, robots: Iterable[str]) -> None:
        """Place robots without a map transform side by side, in the order given."""
        unknown: List[str] = [robot for robot in robots if robot not in self._known]
        middle = (len(unknown) - 1) / 2.0
        self._assumed = {
            robot: Pose((index - middle) * APART_M, 0.0, 0.0) for index, robot in enumerate(unknown)
        }

    def _anchor_of(self, robot: str) -> Pose:
        return self._known.get(robot) or self._assumed.get(robot, NOWHERE)

    def to_map(self, robot: str, pose: Pose) -> Pose:
        """Return a pose in hero_N/odom as a pose on the map."""
        anchor = self._anchor_of(robot)
        cosine, sine = math.cos(anchor.yaw_rad), math.sin(anchor.yaw_rad)
        return Pose(
            anchor.x_m + cosine * pose.x_m - sine * pose.y_m,
            anchor.y_m + sine * pose.x_m + cosine * pose.y_m,
            math.remainder(anchor.yaw_rad + pose.yaw_rad, math.tau),
        )

    def to_odometry(self, robot: str, pose: Pose) -> Pose:
        """Return a pose on the map as a pose in hero_N/odom."""
        anchor = self._anchor_of(robot)
        cosine, sine = math.cos(anchor.yaw_rad), math.sin(anchor.yaw_rad)
        x_m, y_m = pose.x_m - anchor.x_m, pose.y_m - anchor.y_m
        return Pose(
            cosine * x_m + sine * y_m,
            cosine * y_m - sine * x_m,
            math.remainder(pose.yaw_rad - anchor.yaw_rad, math.tau),
        )
