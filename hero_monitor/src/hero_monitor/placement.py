"""Converts between poses in hero_N/odom and poses on the map. Pure.

A robot knows only its pose in hero_N/odom. The simulator or a tracking system publishes on /tf_static where that frame
lies on the map. Robots without such a transform are drawn side by side, and the page says so.
"""

from typing import Dict, Iterable, List

from hero_client.geometry import Pose, invert_pose, transform_pose, wrap_angle

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
        return _wrap(transform_pose(self._anchor_of(robot), pose))

    def to_odometry(self, robot: str, pose: Pose) -> Pose:
        """Return a pose on the map as a pose in hero_N/odom."""
        return _wrap(transform_pose(invert_pose(self._anchor_of(robot)), pose))


def _wrap(pose: Pose) -> Pose:
    return pose._replace(yaw_rad=wrap_angle(pose.yaw_rad))
