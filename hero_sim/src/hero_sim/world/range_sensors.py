"""The signals of each robot's eight infrared sensors, from poses, walls and obstacles; without noise.

Pure: numpy only, over robots x beams x obstacles at once. Source of the infrared model: measurements published by
the robot's authors (signal of a TCRT5000 against a white wall).
"""

import math
from typing import Tuple

import numpy as np

from ..robot_constants import BODY_RADIUS_M

BEAMS = 8
BEAM_ANGLES_RAD = -math.pi + np.arange(BEAMS) * (math.pi / 4.0)
"""Directions in the body frame, counter-clockwise; index 4 is the front sensor."""

ALPHA_COUNTS_M2 = 0.423
BETA_COUNTS = -0.93
"""signal = alpha * cos(angle of incidence) / distance^2 + beta, fitted to the published table (3 to 18
cm)."""

FIT_END_M = 0.18
TABLE_END_M = 0.20
TABLE_END_EXCESS_COUNTS = 12.0 - ALPHA_COUNTS_M2 / TABLE_END_M**2
"""The fit ends at 18 cm: the published table still has 12 counts at 20 cm, where the fit would give 9.6. Between
the two the offset is interpolated, and beyond the table it fades with the light."""

SATURATION_COUNTS = 950.0
"""The signal of anything nearer than about 2 cm."""

NOISE_COUNTS = 1.3
"""Standard deviation of one reading (published: 1 to 1.6 counts)."""

# The diode sees a cone, whose rim is modelled by two more rays of less weight. Half angle and weight are assumptions.
_CONE_RAD = np.array([0.0, -0.21, 0.21])
_CONE_WEIGHT = np.array([1.0, 0.7, 0.7])

_FAR_M = 1e6


def cast_at_segments(
    origins_m: np.ndarray, angles_rad: np.ndarray, segments_m: np.ndarray
) -> Tuple[np.ndarray, np.ndarray]:
    """Return distance (m) and cosine of incidence of the first wall on each ray, both of shape (R, A).

    origins_m (R, 2); angles_rad (R, A) in the world; segments_m (S, 4) as x1 y1 x2 y2. Far away: 1e6 m.
    """
    if not len(segments_m):
        return np.full(angles_rad.shape, _FAR_M), np.zeros(angles_rad.shape)
    ray_x, ray_y = np.cos(angles_rad)[..., None], np.sin(angles_rad)[..., None]
    start_x = segments_m[:, 0] - origins_m[:, 0, None, None]
    start_y = segments_m[:, 1] - origins_m[:, 1, None, None]
    along_x = segments_m[:, 2] - segments_m[:, 0]
    along_y = segments_m[:, 3] - segments_m[:, 1]
    cross = ray_x * along_y - ray_y * along_x
    parallel = np.abs(cross) < 1e-12
    safe = np.where(parallel, 1.0, cross)
    distance_m = (start_x * along_y - start_y * along_x) / safe
    share = (start_x * ray_y - start_y * ray_x) / safe
    hit = ~parallel & (distance_m >= 0.0) & (share >= 0.0) & (share <= 1.0)
    distance_m = np.where(hit, distance_m, _FAR_M)
    first = np.argmin(distance_m, axis=-1)[..., None]
    cosine = np.abs(cross) / np.maximum(np.hypot(along_x, along_y), 1e-12)
    return np.take_along_axis(distance_m, first, -1)[..., 0], np.take_along_axis(cosine, first, -1)[..., 0]


def cast_at_circles(
    origins_m: np.ndarray, angles_rad: np.ndarray, circles_m: np.ndarray
) -> Tuple[np.ndarray, np.ndarray]:
    """Return distance (m) and cosine of incidence of the first circle on each ray, both of shape (R, A).

    circles_m (C, 3) as x y radius. A circle around the origin itself, the robot's own body, is not seen.
    """
    if not len(circles_m):
        return np.full(angles_rad.shape, _FAR_M), np.zeros(angles_rad.shape)
    ray_x, ray_y = np.cos(angles_rad)[..., None], np.sin(angles_rad)[..., None]
    to_x = circles_m[:, 0] - origins_m[:, 0, None, None]
    to_y = circles_m[:, 1] - origins_m[:, 1, None, None]
    radius_m = circles_m[:, 2]
    along_m = ray_x * to_x + ray_y * to_y
    across_m = ray_x * to_y - ray_y * to_x
    inside_m2 = radius_m**2 - across_m**2
    hit = (inside_m2 > 0.0) & (along_m > 0.0)
    depth_m = np.sqrt(np.where(hit, inside_m2, 0.0))
    distance_m = np.where(hit, np.maximum(along_m - depth_m, 0.0), _FAR_M)
    first = np.argmin(distance_m, axis=-1)[..., None]
    cosine = depth_m / radius_m
    return np.take_along_axis(distance_m, first, -1)[..., 0], np.take_along_axis(cosine, first, -1)[..., 0]


def measure_signals(
    poses: np.ndarray,
    which: np.ndarray,
    segments_m: np.ndarray,
    circles_m: np.ndarray,
    alpha_counts_m2: np.ndarray,
    beta_counts: np.ndarray,
) -> np.ndarray:
    """Return the noiseless signal (counts) of the eight sensors of the robots which, shape (R, 8).

    poses (N, 3) of all robots, who see each other as round bodies; which (R,) indices into poses;
    alpha_counts_m2 (R, 8) of each sensor, beta_counts (R, 1) of each robot.
    """
    seen = poses[which]
    rays = BEAM_ANGLES_RAD[:, None] + _CONE_RAD
    angles_rad = (seen[:, 2, None, None] + rays).reshape(len(which), -1)
    bodies_m = np.column_stack((poses[:, :2], np.full(len(poses), BODY_RADIUS_M)))
    wall_m, wall_cosine = cast_at_segments(seen[:, :2], angles_rad, segments_m)
    round_m, round_cosine = cast_at_circles(seen[:, :2], angles_rad, np.vstack((bodies_m, circles_m)))
    nearer = round_m < wall_m
    distance_m = np.where(nearer, round_m, wall_m) - BODY_RADIUS_M
    cosine = np.where(nearer, round_cosine, wall_cosine)
    bright = cosine / np.maximum(distance_m, 1e-3) ** 2
    bright = (bright.reshape(len(which), BEAMS, len(_CONE_RAD)) * _CONE_WEIGHT).max(axis=-1)
    return np.minimum(alpha_counts_m2 * bright + _offset(bright, beta_counts), SATURATION_COUNTS)


def _offset(bright: np.ndarray, beta_counts: np.ndarray) -> np.ndarray:
    """Return the signal's part besides alpha * bright (counts); bright is cosine / distance^2."""
    distance_m = 1.0 / np.sqrt(np.maximum(bright, 1e-12))
    share = np.clip((distance_m - FIT_END_M) / (TABLE_END_M - FIT_END_M), 0.0, 1.0)
    beyond = np.minimum(bright * TABLE_END_M**2, 1.0) * TABLE_END_EXCESS_COUNTS
    return beta_counts + share * (beyond - beta_counts)
