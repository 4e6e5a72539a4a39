"""The map that a swarm makes: scans of all robots, each at the pose that its robot had then. Pure."""

from collections import deque
from typing import Deque, Dict, Sequence, Tuple

import numpy as np

from hero_client.values import StampedHistory, interpolate_pose
from hero_node import Pose

from .occupancy_grid import OccupancyGrid

KEPT_S = 2.0
MAX_WAITING = 20
"""Scans of a robot that wait for its pose: four seconds of them."""


class _Robot:
    """One robot's poses, and its scans for which no pose has come yet."""

    def __init__(self) -> None:
        self.poses: StampedHistory[Pose] = StampedHistory(KEPT_S, interpolate_pose)
        self.scans: Deque[Tuple[float, Sequence[float]]] = deque(maxlen=MAX_WAITING)


class SwarmMap:
    """The grid, and what waits to be put into it."""

    def __init__(self, grid: OccupancyGrid) -> None:
        self.grid = grid
        self._robots: Dict[int, _Robot] = {}

    def add_pose(self, robot_id: int, stamp_s: float, pose: Pose) -> None:
        """Take a robot's pose in map."""
        self._robots.setdefault(robot_id, _Robot()).poses.add(stamp_s, pose)

    def add_ranges(self, robot_id: int, stamp_s: float, ranges_m: Sequence[float]) -> None:
        """Take a robot's ranges: see OccupancyGrid.add_scan()."""
        self._robots.setdefault(robot_id, _Robot()).scans.append((stamp_s, ranges_m))

    def update(self) -> int:
        """Put the scans into the grid whose poses are known by now; return how many."""
        count = 0
        for robot in self._robots.values():
            while robot.scans and robot.scans[0][0] <= robot.poses.newest_s:
                stamp_s, ranges_m = robot.scans.popleft()
                pose = robot.poses.find(stamp_s)
                if pose is not None:
                    others = [other.poses.find(stamp_s) for other in self._robots.values() if other is not robot]
                    places_m = np.array([other[:2] for other in others if other is not None]).reshape(-1, 2)
                    self.grid.add_scan(pose, ranges_m, places_m)
                    count += 1
        return count
