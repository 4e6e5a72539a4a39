"""The flat world that robots drive in: walls, round obstacles and the robots' start poses.

Pure: numpy only; files are read in arena_file. Frame `world`: x right, y up, m; angles counter-clockwise, rad.
"""

import math
from typing import List, NamedTuple, Optional, Sequence, Tuple, Union

import numpy as np

from hero_node import Pose
from hero_node.robot_constants import BODY_RADIUS_M

from ..errors import OptionError
from .pushing.shapes import PushedBody, touch_circle

START_GAP_M = 0.05
"""Free space kept around a robot that is placed at random."""

_MAX_TRIES = 2000

BARE_GRAY = 0.5
"""Gray level of the floor without an area, from 0, black, to 1, white."""


class Area(NamedTuple):
    """A painted part of the floor: a circle, x y radius, or a rectangle, x min, y min, x max, y max; lengths in m.

    Attributes:
        color: red green blue from 0 to 1.
        gray: levels of a picture that fills the rectangle, from 0 to 1 (rows from the upper one, columns); None: color.
    """

    name: str
    shape_m: Tuple[float, ...]
    color: Tuple[float, float, float]
    gray: Optional[np.ndarray] = None

    def covers(self, x_m: np.ndarray, y_m: np.ndarray) -> np.ndarray:
        """Return which points (R,) lie on it."""
        if len(self.shape_m) == 3:
            center_x_m, center_y_m, radius_m = self.shape_m
            circle: np.ndarray = np.hypot(x_m - center_x_m, y_m - center_y_m) <= radius_m
            return circle
        x_min, y_min, x_max, y_max = self.shape_m
        rectangle: np.ndarray = (x_m >= x_min) & (x_m <= x_max) & (y_m >= y_min) & (y_m <= y_max)
        return rectangle

    def find_colors(self, x_m: np.ndarray, y_m: np.ndarray) -> np.ndarray:
        """Return red green blue from 0 to 1 of points on it (R, 3)."""
        if self.gray is None:
            return np.broadcast_to(self.color, (len(x_m), 3))
        x_min, y_min, x_max, y_max = self.shape_m
        shares = (y_max - y_m) / (y_max - y_min), (x_m - x_min) / (x_max - x_min)
        row, column = (
            np.minimum((share * count).astype(int), count - 1) for share, count in zip(shares, self.gray.shape)
        )
        return np.repeat(self.gray[row, column, None], 3, axis=1)


class Arena(NamedTuple):
    """Walls, obstacles and starts of one world.

    Attributes:
        name: for users.
        segments_m: walls and the edges of polygons, shape (S, 4), x1 y1 x2 y2.
        circles_m: round obstacles, shape (C, 3), x y radius.
        starts: free poses of the first robots; the others are placed at random.
        bounds_m: x min, y min, x max, y max of the area in which robots are placed, shape (4,).
        polygons_m: the corners of each solid polygon, whose edges are among the segments.
        objects: what robots can push, where it is at the start; each world moves copies.
        areas: painted parts of the floor, later ones over earlier ones.
        lamps_m: places of lamps (L, 2), x y.
        rims_m: the corners of each closed wall around all the others; what lies outside of it is not free.
    """

    name: str
    segments_m: np.ndarray
    circles_m: np.ndarray
    starts: Tuple[Pose, ...]
    bounds_m: np.ndarray
    polygons_m: Tuple[np.ndarray, ...] = ()
    objects: Tuple[PushedBody, ...] = ()
    areas: Tuple[Area, ...] = ()
    lamps_m: np.ndarray = np.empty((0, 2))
    rims_m: Tuple[np.ndarray, ...] = ()


def square_length(ways_m: np.ndarray) -> np.ndarray:
    """Return the squares of the lengths (...) of vectors (2, ...)."""
    squares_x_m2, squares_y_m2 = ways_m * ways_m
    return squares_x_m2 + squares_y_m2


class Segments(NamedTuple):
    """Straight lines, each an entry of all arrays: where it starts (2, S), x and y, and the way to its end (2, S)."""

    start_m: np.ndarray
    along_m: np.ndarray
    length_m2: np.ndarray

    @classmethod
    def from_ends(cls, ends_m: np.ndarray) -> "Segments":
        """Return the segments with ends_m (S, 4), x1 y1 x2 y2."""
        start_m, end_m = ends_m.T.reshape(2, 2, -1).copy()
        along_m = end_m - start_m
        return cls(start_m, along_m, np.maximum(square_length(along_m), 1e-18))

    def for_each_place(self) -> "Segments":
        """Return the segments for point_away() of places (2, P, 1)."""
        return Segments(self.start_m[:, None], self.along_m[:, None], self.length_m2)

    def point_away(self, places_m: np.ndarray) -> np.ndarray:
        """Return the way (2, S), x and y in m, from the nearest point of each segment to its place (2, S)."""
        to_m = places_m - self.start_m
        along_x_m2, along_y_m2 = to_m * self.along_m
        share = (along_x_m2 + along_y_m2) / self.length_m2
        return to_m - np.minimum(np.maximum(share, 0.0), 1.0) * self.along_m


def outline(corners_m: np.ndarray) -> np.ndarray:
    """Return the walls (S, 4) around the polygon of corners_m (S, 2)."""
    return np.hstack((corners_m, np.roll(corners_m, -1, axis=0)))


def build_rectangle(width_m: float, height_m: float, robots: int) -> Arena:
    """Return a rectangular field around the origin with robots spread over it in rows.

    Each start is headed along the rim, counter-clockwise, so that no robot drives at a neighbor or a wall at once.
    """
    x_m, y_m = width_m / 2.0, height_m / 2.0
    columns = _count_columns(robots)
    rows = math.ceil(robots / columns)
    starts: List[Pose] = []
    for index in range(robots):
        row, column = divmod(index, columns)
        start_x_m, start_y_m = width_m * ((column + 0.5) / columns - 0.5), height_m * ((row + 0.5) / rows - 0.5)
        # On a diagonal two walls are equally near: the one that follows counter-clockwise counts.
        wall = math.floor(math.atan2(start_y_m, start_x_m) / (math.pi / 2.0) + 0.5 + 1e-9)
        at_center = math.hypot(start_x_m, start_y_m) < 1e-9
        yaw_rad = 0.0 if at_center else math.remainder((wall + 1) * (math.pi / 2.0), 2.0 * math.pi)
        starts.append(Pose(start_x_m, start_y_m, yaw_rad))
    walls = outline(np.array([(-x_m, -y_m), (x_m, -y_m), (x_m, y_m), (-x_m, y_m)]))
    bounds_m = np.array([-x_m, -y_m, x_m, y_m])
    return Arena("rectangle", walls, np.empty((0, 3)), tuple(starts), bounds_m)


def build_default(robots: int) -> Arena:
    """Return a square field: 1.5 m wide for up to nine robots, wider for more so that they keep their distance."""
    side_m = max(1.5, 0.4 * _count_columns(robots))
    return build_rectangle(side_m, side_m, robots)


def _count_columns(robots: int) -> int:
    return max(1, math.ceil(math.sqrt(robots)))


def list_obstacles(arena: Arena) -> Tuple[Segments, np.ndarray]:
    """Return all obstacles as segments with a radius (S,): walls have none, circles have no length."""
    ends_m = np.vstack((arena.segments_m, arena.circles_m[:, [0, 1, 0, 1]]))
    return Segments.from_ends(ends_m), np.concatenate((np.zeros(len(arena.segments_m)), arena.circles_m[:, 2]))


def measure_clearance(points_m: np.ndarray, arena: Arena) -> np.ndarray:
    """Return the distance (m) of each point (P, 2) to the nearest wall or obstacle, negative inside an obstacle and
    outside of the arena."""
    obstacles, radii_m = list_obstacles(arena)
    distance_m = np.sqrt(square_length(obstacles.for_each_place().point_away(points_m.T[..., None])))
    clearance_m = (distance_m - radii_m).min(axis=1, initial=np.inf)
    solid = [_lies_inside(points_m, corners_m) for corners_m in arena.polygons_m]
    solid += [~_lies_inside(points_m, corners_m) for corners_m in arena.rims_m]
    for is_solid in solid:
        clearance_m = np.where(is_solid, -np.abs(clearance_m), clearance_m)
    return clearance_m


def _lies_inside(points_m: np.ndarray, corners_m: np.ndarray) -> np.ndarray:
    """Return which points (P,) lie inside the polygon: a ray to the right crosses its outline an odd number
    of times."""
    following_m = np.roll(corners_m, -1, axis=0)
    y_m = points_m[:, 1, None]
    straddles = (corners_m[:, 1] > y_m) != (following_m[:, 1] > y_m)
    rise_m = following_m[:, 1] - corners_m[:, 1]
    share = (y_m - corners_m[:, 1]) / np.where(rise_m == 0.0, 1.0, rise_m)
    cross_x_m = corners_m[:, 0] + share * (following_m[:, 0] - corners_m[:, 0])
    return (straddles & (points_m[:, 0, None] < cross_x_m)).sum(axis=1) % 2 == 1


def place_robots(arena: Arena, robots: int, rng: np.random.RandomState, radius_m: float = BODY_RADIUS_M) -> np.ndarray:
    """Return start poses, shape (robots, 3): the arena's own first, then free places drawn from rng.

    radius_m: of the largest robot. Raises: OptionError if no free place is left.
    """
    poses: List[Pose] = list(arena.starts[:robots])
    while len(poses) < robots:
        poses.append(_draw_place(arena, poses, rng, robots, radius_m))
    return np.array(poses, dtype=float)


def _draw_place(arena: Arena, poses: List[Pose], rng: np.random.RandomState, robots: int, radius_m: float) -> Pose:
    x_min, y_min, x_max, y_max = arena.bounds_m.tolist()
    for _ in range(_MAX_TRIES):
        # Not rng.uniform(): whether it rounds once or twice depends on how numpy was compiled.
        x_share, y_share, turn = rng.random_sample(3).tolist()
        pose = Pose(x_min + x_share * (x_max - x_min), y_min + y_share * (y_max - y_min), (2.0 * turn - 1.0) * math.pi)
        if is_free(pose, poses, arena, radius_m + START_GAP_M, radius_m):
            return pose
    raise OptionError(
        "arena %s: no free place for robot %d of %d; take fewer robots or a larger arena"
        % (arena.name, len(poses) + 1, robots)
    )


def is_free(
    pose: Pose,
    poses: Union[Sequence[Pose], np.ndarray],
    arena: Arena,
    radius_m: float,
    other_radius_m: float = BODY_RADIUS_M,
) -> bool:
    """Return whether a robot with radius_m fits at pose, beside robots with other_radius_m at poses."""
    if measure_clearance(np.array([pose[:2]]), arena)[0] < radius_m:
        return False
    if any(touch_circle(*pose[:2], radius_m, thing).depth_m > 0.0 for thing in arena.objects):
        return False
    if not len(poses):
        return True
    apart_x_m, apart_y_m = np.array(poses)[:, 0] - pose.x_m, np.array(poses)[:, 1] - pose.y_m
    min_distance_m = radius_m + other_radius_m
    return bool((apart_x_m * apart_x_m + apart_y_m * apart_y_m).min() >= min_distance_m * min_distance_m)
