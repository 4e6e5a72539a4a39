"""Sensors of neighbors, computed from poses: one function for each sensor.

Pure: numpy only, over all robots of W worlds with N robots each; robots of different worlds never sense each other.
Poses are (W, N, 3), x m, y m, yaw rad, in one frame; NaN for a robot whose pose is not known, which senses nothing
and is not sensed. Only places count, so the order of the robots, and their ids, change nothing.
"""

import math
from typing import Any, Callable, List, NamedTuple, Optional, Sequence

import numpy as np

from hero_node.robot_constants import BODY_RADIUS_M

_CACHED_PAIRS = 16384
"""Pairs of robots that are computed at once: they fit the processor's cache."""


class Binary(NamedTuple):
    """A sensor in the front rim that tells whether a beam or cone straight ahead touches another body."""

    half_angle_rad: float = 0.0
    """0 is a beam."""
    range_m: float = math.inf
    """To the surface of the other body."""
    error: float = 0.0
    """Probability that a reading is wrong."""


class Neighbors(NamedTuple):
    """A sensor that tells where other robots are, and how they are turned."""

    range_m: float = math.inf
    """Distance between the centers."""
    field_rad: float = 2.0 * math.pi
    """Width of the field of view, centered on the front."""
    range_noise_m: float = 0.0
    bearing_noise_rad: float = 0.0
    """Standard deviations; the relative heading has that of the bearing."""
    dropout: float = 0.0
    """Probability that a neighbor is missed."""
    occlusion: bool = False
    """True if bodies hide those behind them."""


class Neighbor(NamedTuple):
    """One robot that another one senses."""

    robot_id: int
    range_m: float
    """Distance between the centers."""
    bearing_rad: float
    """Counter-clockwise from the front of the robot that senses, -pi..pi."""
    heading_rad: float
    """Relative to the heading of the robot that senses, -pi..pi."""


class Neighborhood(NamedTuple):
    """Neighbors sensed by R robots; each array has one column for every robot of the same world (R, N).

    Attributes:
        seen: which neighbors are sensed; never the robot itself. The other arrays are 0 where it is False.
        forward_m, left_m: places in the body frame.
        heading_rad: relative to the robot's own, -pi..pi.
        rows: row of the neighbor, for what robots tell each other.
    """

    seen: np.ndarray
    forward_m: np.ndarray
    left_m: np.ndarray
    heading_rad: np.ndarray
    rows: np.ndarray

    @property
    def range_m(self) -> np.ndarray:
        """Distances between the centers (R, N)."""
        return _measure_length(self.forward_m, self.left_m)

    @property
    def bearing_rad(self) -> np.ndarray:
        """Directions, counter-clockwise from the front (R, N), -pi..pi."""
        return np.arctan2(self.left_m, self.forward_m)

    @property
    def counts(self) -> np.ndarray:
        """Number of neighbors that each robot senses (R,)."""
        return self.seen.sum(axis=1)

    def average(self, values: np.ndarray) -> np.ndarray:
        """Return the mean of values (R, N) over the neighbors of each robot (R,); 0 without neighbors."""
        return (values * self.seen).sum(axis=1) / np.maximum(self.counts, 1)


def list_neighbors(near: Neighborhood, row: int, ids: Sequence[int]) -> List[Neighbor]:
    """Return what the robot at row senses, nearest first; ids: of the robots of its world, by column (N,)."""
    values = zip(ids, near.range_m[row].tolist(), near.bearing_rad[row].tolist(), near.heading_rad[row].tolist())
    found = [Neighbor(*value) for value, is_seen in zip(values, near.seen[row].tolist()) if is_seen]
    return sorted(found, key=lambda neighbor: neighbor.range_m)


def _measure_length(x_m: np.ndarray, y_m: np.ndarray) -> np.ndarray:
    """Return what np.hypot() returns, several times as fast: places are neither huge nor tiny."""
    length_m: np.ndarray = np.sqrt(x_m * x_m + y_m * y_m)
    return length_m


def look_at(poses: np.ndarray, others: np.ndarray, forward_m: float) -> Any:
    """Return where others (W, M, 3) are, to the front and to the left (W, N, M), forward_m ahead of each robot."""
    cosine, sine = np.cos(poses[..., 2])[..., None], np.sin(poses[..., 2])[..., None]
    to_x_m, to_y_m = (others[:, None, :, axis] - poses[:, :, None, axis] for axis in (0, 1))
    return cosine * to_x_m + sine * to_y_m - forward_m, cosine * to_y_m - sine * to_x_m


def sense_binary(
    poses: np.ndarray, sensor: Binary, random: Optional[Any] = None, find_touched: Optional[Callable[..., None]] = None
) -> np.ndarray:
    """Return what each robot's sensor tells (W * N,).

    random: needed for a sensor with errors; random.random() returns one number from 0 to 1 for each robot (W * N,).
    find_touched: does for beams, faster, what is done here: that of hero_swarm.sensors.pair_loops.
    """
    if find_touched is not None and sensor.half_angle_rad == 0.0:
        places_m, sees = np.ascontiguousarray(poses[..., :2].transpose(2, 0, 1)), np.zeros(poses.shape[:2], dtype=bool)
        headings = np.cos(poses[..., 2]), np.sin(poses[..., 2])
        find_touched(places_m, *headings, BODY_RADIUS_M, float(sensor.range_m), sees)
        sees = sees.ravel()
    else:
        at_once = max(1, _CACHED_PAIRS // poses.shape[1] ** 2)
        worlds = [poses[first : first + at_once] for first in range(0, max(len(poses), 1), at_once)]
        sees = np.concatenate([_find_touched(some, sensor) for some in worlds])
    if sensor.error > 0.0 and random is not None:
        sees ^= random.random() < sensor.error
        sees &= np.isfinite(poses).all(axis=2).ravel()
    return sees


def _find_touched(poses: np.ndarray, sensor: Binary) -> np.ndarray:
    """Return whether each robot's sensor touches another body (W * N,)."""
    ahead_m, left_m = look_at(poses, poses, BODY_RADIUS_M)
    with np.errstate(invalid="ignore"):
        square_m2 = ahead_m * ahead_m + left_m * left_m
        # The tangents to a body span an angle whose sine is its radius over the distance of its center.
        if sensor.half_angle_rad == 0.0:
            touched = (np.abs(left_m) < BODY_RADIUS_M) & (ahead_m > 0.0)
        else:
            spread_rad = np.arcsin(np.minimum(BODY_RADIUS_M / np.maximum(np.sqrt(square_m2), 1e-9), 1.0))
            touched = np.abs(np.arctan2(left_m, ahead_m)) < sensor.half_angle_rad + spread_rad
        if sensor.range_m < math.inf:  # most sensors have no limit, and all pairs of robots are computed
            if sensor.half_angle_rad == 0.0:
                gap_m = ahead_m - np.sqrt(np.maximum(BODY_RADIUS_M * BODY_RADIUS_M - left_m * left_m, 0.0))
            else:
                gap_m = np.sqrt(square_m2) - BODY_RADIUS_M
            touched &= gap_m <= sensor.range_m
        touched |= square_m2 <= BODY_RADIUS_M * BODY_RADIUS_M
    robots = poses.shape[1]
    touched[:, np.arange(robots), np.arange(robots)] = False
    seen: np.ndarray = touched.any(axis=2).ravel()
    return seen


def sense_neighbors(
    poses: np.ndarray, sensor: Neighbors, random: Optional[Any] = None, find_near: Optional[Callable[..., None]] = None
) -> Neighborhood:
    """Return what all W * N robots sense of their neighbors.

    random: needed for noise and drop-outs; random.normal(N) and random.random(N) return arrays (W * N, N).
    find_near: does for a sensor with a range alone, faster, what is done here: that of hero_swarm.sensors.pair_loops.
    """
    worlds, robots, _ = poses.shape
    rows = np.repeat(np.arange(worlds * robots).reshape(worlds, robots), robots, axis=0)
    if find_near is not None and sensor == Neighbors(range_m=sensor.range_m):
        seen, found = np.empty((worlds, robots, robots), dtype=bool), np.empty((3, worlds, robots, robots))
        find_near(poses, np.cos(poses[..., 2]), np.sin(poses[..., 2]), float(sensor.range_m), seen, found)
        forward_m, left_m, heading_rad = found.reshape(3, -1, robots)
        return Neighborhood(seen.reshape(-1, robots), forward_m, left_m, heading_rad, rows)
    forward_m, left_m = look_at(poses, poses, 0.0)
    with np.errstate(invalid="ignore"):
        range_m = _measure_length(forward_m, left_m)
        seen = range_m <= sensor.range_m
        if sensor.field_rad < 2.0 * math.pi:
            seen &= np.abs(np.arctan2(left_m, forward_m)) <= sensor.field_rad / 2.0
    seen[:, np.arange(robots), np.arange(robots)] = False
    if sensor.occlusion:
        seen &= ~_find_hidden(forward_m, left_m, range_m)
    seen = seen.reshape(-1, robots)
    heading_rad = (poses[:, None, :, 2] - poses[:, :, None, 2]).reshape(-1, robots)
    forward_m, left_m = forward_m.reshape(-1, robots), left_m.reshape(-1, robots)
    if random is not None:
        if sensor.dropout > 0.0:
            seen &= random.random(robots) >= sensor.dropout
        if sensor.range_noise_m > 0.0 or sensor.bearing_noise_rad > 0.0:
            stretch = 1.0 + sensor.range_noise_m * random.normal(robots) / np.maximum(range_m.reshape(-1, robots), 1e-9)
            off_rad = sensor.bearing_noise_rad * random.normal(robots)
            cosine, sine = stretch * np.cos(off_rad), stretch * np.sin(off_rad)
            forward_m, left_m = cosine * forward_m - sine * left_m, sine * forward_m + cosine * left_m
            heading_rad = heading_rad + sensor.bearing_noise_rad * random.normal(robots)
    heading_rad = heading_rad - 2.0 * math.pi * np.rint(heading_rad / (2.0 * math.pi))
    forward_m, left_m, heading_rad = (np.where(seen, values, 0.0) for values in (forward_m, left_m, heading_rad))
    return Neighborhood(seen, forward_m, left_m, heading_rad, rows)


def _find_hidden(forward_m: np.ndarray, left_m: np.ndarray, range_m: np.ndarray) -> np.ndarray:
    """Return which robots (W, N, N) are behind the body of a third one: their centers are not in sight."""
    safe_m = np.maximum(range_m, 1e-9)
    ahead, across = forward_m / safe_m, left_m / safe_m
    # Of robot k, seen by robot i in the direction of robot j: how far along, and how far aside.
    along_m = ahead[..., None] * forward_m[:, :, None] + across[..., None] * left_m[:, :, None]
    aside_m = ahead[..., None] * left_m[:, :, None] - across[..., None] * forward_m[:, :, None]
    hides = (np.abs(aside_m) < BODY_RADIUS_M) & (along_m > 1e-9) & (along_m < range_m[..., None] - 1e-9)
    robots = range_m.shape[1]
    hides[:, :, np.arange(robots), np.arange(robots)] = False
    result: np.ndarray = hides.any(axis=3)
    return result
