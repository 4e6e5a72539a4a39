"""A map of the arena from the proximity ranges and poses of many robots: log-odds of each cell. Pure.

Each infrared sensor sees a cone. What is nearer in it than the range is free; somewhere at the range is an obstacle,
most likely at the middle of the cone. Source: S. Thrun, W. Burgard, D. Fox, Probabilistic Robotics, chapter 9.2.
"""

import math
from collections import deque
from typing import Deque, Dict, Sequence, Tuple

import cv2
import numpy as np
from scipy import ndimage

from hero_client.values import BODY_RADIUS_M, MIN_RANGE_M, StampedHistory, interpolate_pose
from hero_node import Pose
from hero_node.robot_constants import BEAMS

CONE_RAD = 0.21
"""Half of what a sensor sees (assumed, as in the simulator)."""

REACH_M = 0.20
"""Reach of a range, from the robot's center: weak echoes beyond are noise."""

FREE_REACH_M = 0.15
"""Up to here nothing in range means free; an obstacle at an angle may not be detected from further away."""

NEAR_SD_M = 0.004
SD_SHARE = 0.04
"""Error of a range: of one at the body, and what it grows by with the distance from the body."""

SURE_M = 0.08
MIN_WEIGHT = 0.15
"""Ranges up to here count fully, those at the end of the reach least: at an angle to a wall they are too long."""

HIT_SD_RAD = 0.08
HIT_LOG_ODDS = 1.6
FREE_LOG_ODDS = -0.35
BODY_LOG_ODDS = -2.0
"""The cells under a robot's own body are free."""

LIMIT_LOG_ODDS = 8.0
KNOWN_LOG_ODDS = 0.5
"""A cell counts as free or occupied beyond this."""

MIN_FRONTIER_CELLS = 5
"""Shorter stretches are gaps between two robots' readings."""

OTHERS_MARGIN_M = 0.03
"""Ranges that end this near another robot's body are that robot."""

KEPT_S = 2.0
MAX_WAITING = 20
"""Scans of a robot that wait for its pose: four seconds of them."""


class OccupancyGrid:
    """Log-odds of the cells of a rectangle, and what follows from them.

    cell_m: side of a cell.
    origin_m: x, y of the lower left corner of cell [0, 0].
    log_odds: (rows, columns), row by y and column by x; 0: not known, positive: occupied.
    """

    def __init__(self, bounds_m: Tuple[float, float, float, float], cell_m: float = 0.01) -> None:
        """bounds_m: x min, y min, x max, y max. Raises: ValueError for bounds without an area."""
        x_min_m, y_min_m, x_max_m, y_max_m = bounds_m
        if not (x_max_m - x_min_m >= cell_m > 0.0 and y_max_m - y_min_m >= cell_m):
            raise ValueError(f"bounds must be x min, y min, x max, y max, not {bounds_m!r}")
        self.cell_m = cell_m
        self.origin_m = (float(x_min_m), float(y_min_m))
        shape = (math.ceil((y_max_m - y_min_m) / cell_m), math.ceil((x_max_m - x_min_m) / cell_m))
        self.log_odds = np.zeros(shape, dtype=np.float32)

    def add_scan(self, pose: Pose, ranges_m: Sequence[float], others_m: np.ndarray) -> None:
        """Add one scan of a robot at pose.

        ranges_m: eight ranges as Robot.proximity gives them (from the center, front first; inf: nothing, 0: too close,
        nan: not known). others_m: x, y (K, 2) of the other robots.
        """
        rows, columns, x_m, y_m = self._cut(pose)
        if not len(x_m) or not len(y_m):
            return
        apart_x_m, apart_y_m = x_m - pose.x_m, (y_m - pose.y_m)[:, None]
        distance_m = np.sqrt(apart_x_m**2 + apart_y_m**2)
        beams = np.arctan2(apart_y_m, apart_x_m)
        beams -= pose.yaw_rad
        beams *= BEAMS / math.tau
        nearest = np.rint(beams)
        aside_rad = (beams - nearest) * (math.tau / BEAMS)
        nearest = nearest.astype(int) % BEAMS
        free_m, hit_m = self._judge(pose, ranges_m, others_m)
        sd_m = NEAR_SD_M + SD_SHARE * (free_m - BODY_RADIUS_M)
        weight = np.clip((REACH_M - free_m) / (REACH_M - SURE_M), MIN_WEIGHT, 1.0) * np.isfinite(hit_m)
        change = np.where(distance_m < (free_m - 2.0 * sd_m)[nearest], np.float32(FREE_LOG_ODDS), np.float32(0.0))
        change[np.abs(aside_rad) > CONE_RAD] = 0.0
        beyond = (distance_m - free_m[nearest]) / sd_m[nearest]
        hit = np.exp(-0.5 * (np.minimum(beyond**2, 50.0) + (aside_rad / HIT_SD_RAD) ** 2))
        change += HIT_LOG_ODDS * weight[nearest] * hit
        change[distance_m < BODY_RADIUS_M - self.cell_m] = BODY_LOG_ODDS
        cells = self.log_odds[rows, columns]
        cells += change
        np.clip(cells, -LIMIT_LOG_ODDS, LIMIT_LOG_ODDS, out=cells)

    def _cut(self, pose: Pose) -> Tuple[slice, slice, np.ndarray, np.ndarray]:
        """Return the rows and columns within reach of pose, and the centers of their cells, x and y in m."""
        slices, centers = [], []
        for place_m, origin_m, count in zip(pose[:2], self.origin_m, self.log_odds.shape[::-1]):
            first = max(0, math.floor((place_m - REACH_M - origin_m) / self.cell_m))
            last = min(count, math.ceil((place_m + REACH_M - origin_m) / self.cell_m))
            slices.append(slice(first, max(first, last)))
            centers.append(origin_m + (np.arange(first, max(first, last)) + 0.5) * self.cell_m)
        return slices[1], slices[0], centers[0], centers[1]

    @staticmethod
    def _judge(pose: Pose, ranges_m: Sequence[float], others_m: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return for each sensor up to where it saw nothing, and where the obstacle is, m; inf: no obstacle."""
        ranges = np.asarray(ranges_m, dtype=float)
        hit_m = np.where(ranges == 0.0, MIN_RANGE_M, ranges)
        free_m = np.where(np.isinf(ranges), FREE_REACH_M, np.where(np.isnan(ranges), 0.0, hit_m))
        hit_m = np.where(np.isnan(ranges) | (hit_m > REACH_M), np.inf, hit_m)
        free_m = np.minimum(free_m, REACH_M)
        if len(others_m):
            for beam in np.flatnonzero(np.isfinite(hit_m)):
                bearing_rad = pose.yaw_rad + beam * math.tau / BEAMS
                for off_rad in (-CONE_RAD, 0.0, CONE_RAD):
                    x_m = pose.x_m + hit_m[beam] * math.cos(bearing_rad + off_rad)
                    y_m = pose.y_m + hit_m[beam] * math.sin(bearing_rad + off_rad)
                    gap_m = np.hypot(others_m[:, 0] - x_m, others_m[:, 1] - y_m).min() - BODY_RADIUS_M
                    if gap_m < OTHERS_MARGIN_M:
                        hit_m[beam] = np.inf
                        break
        return free_m, hit_m

    @property
    def occupied(self) -> np.ndarray:
        """Which cells hold the surface of an obstacle (rows, columns).

        Ranges at an angle to a wall are too long, and nothing clears what they leave behind the wall: so only what is
        in reach of a cell that is rather free counts, with one uncertain cell between them at most.
        """
        solid = self.log_odds > KNOWN_LOG_ODDS
        return np.asarray(solid & _widen(_widen(self.log_odds < 0.0) & ~solid))

    @property
    def free(self) -> np.ndarray:
        """Which cells are free (rows, columns)."""
        return np.asarray(self.log_odds < -KNOWN_LOG_ODDS)

    @property
    def known_share(self) -> float:
        """Share of the cells that are free or occupied, 0..1."""
        return float((np.abs(self.log_odds) > KNOWN_LOG_ODDS).mean())

    @property
    def frontiers(self) -> np.ndarray:
        """Which free cells are next to an unknown one, away from obstacles (rows, columns)."""
        unknown = np.abs(self.log_odds) <= KNOWN_LOG_ODDS
        return np.asarray(self.free & _widen(unknown & ~_widen(_widen(self.log_odds > KNOWN_LOG_ODDS))))

    def find_frontiers(self) -> np.ndarray:
        """Return x, y (K, 2) of a free cell in the middle of each stretch of frontier, the longest first."""
        labels, count = ndimage.label(self.frontiers, structure=np.ones((3, 3)))
        found = []
        for label in range(1, count + 1):
            cells_m = self.centers_of(labels == label)
            if len(cells_m) >= MIN_FRONTIER_CELLS:
                off_m = np.hypot(*(cells_m - cells_m.mean(axis=0)).T)
                found.append((len(cells_m), cells_m[off_m.argmin()]))
        found.sort(key=lambda item: -item[0])
        return np.array([place_m for _, place_m in found]).reshape(-1, 2)

    def to_percent(self) -> np.ndarray:
        """Return how likely each cell is occupied, in percent (rows, columns), int8, -1: not known."""
        percent = np.rint(100.0 / (1.0 + np.exp(-self.log_odds))).astype(np.int8)
        percent[~(self.free | self.occupied)] = -1
        return percent

    def centers_of(self, cells: np.ndarray) -> np.ndarray:
        """Return x, y (K, 2) of the centers of those cells (rows, columns) that are true."""
        rows, columns = np.nonzero(cells)
        x_m = self.origin_m[0] + (columns + 0.5) * self.cell_m
        return np.column_stack((x_m, self.origin_m[1] + (rows + 0.5) * self.cell_m))


def _widen(cells: np.ndarray) -> np.ndarray:
    """Return cells and their eight neighbors (rows, columns); scipy's binary_dilation takes 20 times as long."""
    return cv2.dilate(cells.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0


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
