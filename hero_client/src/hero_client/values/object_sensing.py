"""Sensors of objects that robots can push, computed from poses as those of neighbors are (sensing).

Pure: numpy only, over W worlds with N robots and M objects each. An object counts as the circle around it.
"""

import math
from typing import NamedTuple

import numpy as np

from hero_node.robot_constants import BODY_RADIUS_M

from .sensing import look_at

NOTHING, OBJECT, ROBOT = 0, 1, 2
"""Values of a Sight."""


class PlacedObjects(NamedTuple):
    """The objects of W worlds.

    Attributes:
        poses: of their centers (W, M, 3), in the frame of the robots' poses.
        radii_m: of the circle around each (M,).
    """

    poses: np.ndarray
    radii_m: np.ndarray


NO_OBJECTS = PlacedObjects(np.empty((1, 0, 3)), np.empty(0))


class Sight(NamedTuple):
    """A beam straight ahead from the front rim that tells what it touches first: NOTHING, an OBJECT or a ROBOT."""

    range_m: float = math.inf


class Objects(NamedTuple):
    """A sensor that tells where objects are, and how they are turned."""

    range_m: float = math.inf
    """Distance between the centers."""


class ObjectsInSight(NamedTuple):
    """Objects sensed by R robots in a world with M objects.

    Attributes:
        seen: which are sensed (R, M); the other arrays are 0 where it is False.
        forward_m, left_m: places of their centers in the body frame (R, M).
        heading_rad: relative to the robot's own (R, M), -pi..pi.
        radii_m: of the circle around each (M,).
    """

    seen: np.ndarray
    forward_m: np.ndarray
    left_m: np.ndarray
    heading_rad: np.ndarray
    radii_m: np.ndarray


def sense_sight(poses: np.ndarray, things: PlacedObjects, sensor: Sight) -> np.ndarray:
    """Return what the beam of each robot touches first (W * N,): NOTHING, OBJECT or ROBOT."""
    robots = poses.shape[1]
    to_robots_m = _measure_gaps(poses, poses, np.full(robots, BODY_RADIUS_M))
    to_robots_m[:, np.arange(robots), np.arange(robots)] = np.inf
    robot_m = to_robots_m.min(axis=2)
    object_m = _measure_gaps(poses, things.poses, things.radii_m).min(axis=2, initial=np.inf)
    seen = np.where(robot_m < object_m, ROBOT, OBJECT)
    nearest_m = np.minimum(robot_m, object_m)
    result: np.ndarray = np.where((nearest_m <= sensor.range_m) & (nearest_m < np.inf), seen, NOTHING).ravel()
    return result


def _measure_gaps(poses: np.ndarray, others: np.ndarray, radii_m: np.ndarray) -> np.ndarray:
    """Return how far the beams go until they enter each circle (W, N, M); inf if they miss it."""
    ahead_m, left_m = look_at(poses, others, BODY_RADIUS_M)
    with np.errstate(invalid="ignore"):
        depth_m = np.sqrt(np.maximum(radii_m * radii_m - left_m * left_m, 0.0))
        touched = (np.abs(left_m) < radii_m) & (ahead_m + depth_m > 0.0)
        return np.where(touched, np.maximum(ahead_m - depth_m, 0.0), np.inf)


def sense_objects(poses: np.ndarray, things: PlacedObjects, sensor: Objects) -> ObjectsInSight:
    """Return what all W * N robots sense of objects."""
    shape = poses.shape[0] * poses.shape[1], things.poses.shape[1]
    forward_m, left_m = (values.reshape(shape) for values in look_at(poses, things.poses, 0.0))
    heading_rad = (things.poses[:, None, :, 2] - poses[:, :, None, 2]).reshape(shape)
    heading_rad = heading_rad - 2.0 * math.pi * np.rint(heading_rad / (2.0 * math.pi))
    with np.errstate(invalid="ignore"):
        seen = np.hypot(forward_m, left_m) <= sensor.range_m
    forward_m, left_m, heading_rad = (np.where(seen, values, 0.0) for values in (forward_m, left_m, heading_rad))
    return ObjectsInSight(seen, forward_m, left_m, heading_rad, things.radii_m)
