"""Robots beside those that a program commands: where they are, as bodies to be avoided."""

import time
from typing import List, Sequence, Set

import numpy as np

from hero_client.ros import share_drivers, share_poses
from hero_client.values import HERO, MODELS
from hero_msgs.msg import Robot
from hero_node import list_names

from .pose_source import SIMULATOR_FRAME, PoseSource

LOOK_PERIOD_S = 1.0
"""Time between two looks for robots that have joined a driver or that localize has found."""


class OtherRobots:
    """The robots of all drivers, and those that localize knows, but for those that are commanded."""

    def __init__(self, own_ids: Sequence[int], frame: str) -> None:
        """Begin; frame: of their poses, as in PoseSource."""
        self._frame = frame
        self._source = PoseSource([], frame)
        self._known = set(own_ids)
        self._ids: List[int] = []
        self._joined: Set[int] = set()
        self._lost: List[str] = []
        self._next_look_s = 0.0

    def read(self) -> np.ndarray:
        """Return x m, y m and body radius m of those whose poses are known (M, 3)."""
        if time.monotonic() >= self._next_look_s:
            self._next_look_s = time.monotonic() + LOOK_PERIOD_S
            self._look()
        poses, _ = self._source.read()
        is_known = np.isfinite(poses).all(axis=1)
        lost = [robot_id for robot_id, known in zip(self._ids, is_known.tolist()) if not known]
        self._lost = ["hero_%d" % robot_id for robot_id in lost if robot_id in self._joined]
        models = [MODELS.get(share_drivers().find_model("/hero_%d" % robot_id), HERO) for robot_id in self._ids]
        radii_m = np.array([model.body_radius_m for model in models])
        return np.column_stack((poses[:, :2], radii_m))[is_known]

    def _look(self) -> None:
        report = share_drivers().read()
        robots = report.robots if report else []
        self._joined = {robot.id for robot in robots if robot.id >= 0 and robot.state != Robot.REFUSED}
        found = set(self._joined)
        if self._frame != SIMULATOR_FRAME:
            found |= share_poses().ids
        new = sorted(found - self._known)
        self._known.update(new)
        self._ids += new
        self._source.add_robots(new)

    def describe_missing(self) -> str:
        """Return which robots of the drivers are not avoided, for users; empty if all poses are known."""
        text = "not avoided, for want of a pose in the frame %s: %s"
        return text % (self._frame, list_names(self._lost)) if self._lost else ""
