"""Converts between poses in hero_N/odom and poses on the map. Pure.

A robot knows only its pose in hero_N/odom. While hero_localization tells where robots are in its frame, the map has
that frame. Otherwise the simulator or a tracking system publishes on /tf_static where hero_N/odom lies on the map.
Robots without a place are drawn side by side, and the page says so.
"""

from typing import Dict, Iterable, List, Tuple

from hero_node import Pose, find_frame, invert_pose, transform_pose

APART_M = 1.0
"""Distance between the origins of robots that are drawn side by side: farther than a short drive."""

NOWHERE = Pose(0.0, 0.0, 0.0)


class Placement:
    """The odometry frames of all robots on the map."""

    def __init__(self, map_frame: str) -> None:
        self._static_frame = map_frame.lstrip("/")
        self._static: Dict[str, Pose] = {}
        self._localized_frame = ""
        self._localized: Dict[str, Pose] = {}
        self._assumed: Dict[str, Pose] = {}

    def receive_transform(self, parent: str, child: str, pose: Pose) -> None:
        """Take one transform; all but those from the map's frame to an odometry frame are ignored."""
        robot, _, frame = child.lstrip("/").rpartition("/")
        if parent.lstrip("/") == self._static_frame and frame == "odom" and robot:
            self._static[robot] = pose

    def localize(self, frame: str, poses: Dict[str, Tuple[Pose, Pose]]) -> None:
        """Place robots by their poses in a frame, and in hero_N/odom at the same time; without any, by /tf_static."""
        self._localized_frame = frame.lstrip("/")
        self._localized = {robot: find_frame(pose, odom) for robot, (pose, odom) in poses.items()}

    @property
    def is_localized(self) -> bool:
        """Return whether the map has the frame of hero_localization."""
        return bool(self._localized)

    @property
    def frame(self) -> str:
        """The map's frame."""
        return self._localized_frame if self._localized else self._static_frame

    @property
    def _known(self) -> Dict[str, Pose]:
        return self._localized or self._static

    def knows(self, robot: str) -> bool:
        """Return whether it is known where a robot's odometry frame lies on the map."""
        return robot in self._known

    def set_robots(self, robots: Iterable[str]) -> None:
        """Place robots without a map transform side by side, in the order given."""
        unknown: List[str] = [robot for robot in robots if robot not in self._known]
        middle = (len(unknown) - 1) / 2.0
        self._assumed = {robot: Pose((index - middle) * APART_M, 0.0, 0.0) for index, robot in enumerate(unknown)}

    def _anchor_of(self, robot: str) -> Pose:
        return self._known.get(robot) or self._assumed.get(robot, NOWHERE)

    def to_map(self, robot: str, pose: Pose) -> Pose:
        """Return a pose in hero_N/odom as a pose on the map."""
        return transform_pose(self._anchor_of(robot), pose)

    def to_goal(self, robot: str, pose: Pose) -> Tuple[str, Pose]:
        """Return frame and pose of a robot's goal on the map: localized robots follow the corrections of their pose."""
        if robot in self._localized:
            return self._localized_frame, pose
        return robot + "/odom", transform_pose(invert_pose(self._anchor_of(robot)), pose)
