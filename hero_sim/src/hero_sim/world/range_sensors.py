"""The signals of each robot's eight infrared sensors, from poses, walls and obstacles; without noise.

Pure: numpy only, over robots x obstacles x rays at once, and the same bits on every machine. Source of the infrared
model: measurements published by the robot's authors (signal of a TCRT5000 against a white wall).
"""

import math
from typing import NamedTuple, Sequence, Tuple

import numpy as np

from ..robot_constants import BODY_RADIUS_M
from .arena import Arena
from .kinematics import find_heading

BEAMS = 8
BEAM_ANGLES_RAD = -math.pi + np.arange(BEAMS) * (math.pi / 4.0)
"""Directions in the body frame, counter-clockwise; index 4 is the front sensor."""

ALPHA_COUNTS_M2 = 0.423
BETA_COUNTS = -0.93
"""signal = alpha * cos(angle of incidence) / distance^2 + beta, fitted to the published table (3 to 18
cm)."""

FIT_END_M = 0.18
TABLE_END_M = 0.20
TABLE_END_EXCESS_COUNTS = 12.0 - ALPHA_COUNTS_M2 / (TABLE_END_M * TABLE_END_M)
"""The fit ends at 18 cm: the published table still has 12 counts at 20 cm, where the fit would give 9.6. Between
the two the offset is interpolated, and beyond the table it fades with the light."""

SATURATION_COUNTS = 950.0
"""The signal of anything nearer than about 2 cm."""

NOISE_COUNTS = 1.3
"""Standard deviation of one reading (published: 1 to 1.6 counts)."""

# The diode sees a cone, whose rim is modelled by two more rays of less weight. Half angle and weight are assumptions.
_CONE_RAD = np.array([0.0, -0.21, 0.21])
_CONE_WEIGHT = np.array([1.0, 0.7, 0.7])
_RAYS = np.array(find_heading((BEAM_ANGLES_RAD[:, None] + _CONE_RAD).ravel()))
"""Directions of all rays in the body frame, x and y (2, A)."""

_FAR_M = 1e6


class Hits(NamedTuple):
    """Where rays meet things: one entry for each thing that a ray meets; all arrays (H,).

    Attributes:
        rays: number of the ray, counted over robots and directions.
        distance_m: from the robot's center.
        cosine: of the angle of incidence.
    """

    rays: np.ndarray
    distance_m: np.ndarray
    cosine: np.ndarray


def hit_segments(origins_m: np.ndarray, ray_x: np.ndarray, ray_y: np.ndarray, segments_m: np.ndarray) -> Hits:
    """Return what rays from origins_m (R, 2) in directions ray_x, ray_y (R, A) meet of walls (S, 4), x1 y1 x2 y2."""
    start_x = (segments_m[:, 0] - origins_m[:, 0, None])[..., None]
    start_y = (segments_m[:, 1] - origins_m[:, 1, None])[..., None]
    along_x = (segments_m[:, 2] - segments_m[:, 0])[:, None]
    along_y = (segments_m[:, 3] - segments_m[:, 1])[:, None]
    ray_x, ray_y = ray_x[:, None], ray_y[:, None]
    cross = ray_x * along_y - ray_y * along_x
    parallel = np.abs(cross) < 1e-12
    cross[parallel] = 1.0
    share = (start_x * ray_y - start_y * ray_x) / cross
    distance_m = (start_x * along_y - start_y * along_x) / cross
    hit = (distance_m >= 0.0) & (share >= 0.0) & (share <= 1.0) & ~parallel
    robots, segments, rays = np.nonzero(hit)
    length_m = np.sqrt(along_x * along_x + along_y * along_y)[segments, 0]
    return Hits(robots * ray_x.shape[2] + rays, distance_m[hit], np.abs(cross[hit]) / np.maximum(length_m, 1e-12))


def hit_circles(
    to_x_m: np.ndarray, to_y_m: np.ndarray, radii_m: np.ndarray, ray_x: np.ndarray, ray_y: np.ndarray
) -> Hits:
    """Return what rays in directions ray_x, ray_y (R, A) meet of circles (C,) with centers at to_x_m, to_y_m (R, C).

    A circle around the origin itself, the robot's own body, is not seen.
    """
    across_m = ray_x[:, None] * to_y_m[..., None] - ray_y[:, None] * to_x_m[..., None]
    robots, circles, rays = np.nonzero(across_m * across_m < (radii_m * radii_m)[:, None])
    along_m = ray_x[robots, rays] * to_x_m[robots, circles] + ray_y[robots, rays] * to_y_m[robots, circles]
    ahead = along_m > 0.0
    robots, circles, rays = robots[ahead], circles[ahead], rays[ahead]
    across_m, radius_m = across_m[robots, circles, rays], radii_m[circles]
    depth_m = np.sqrt(radius_m * radius_m - across_m * across_m)
    distance_m = np.maximum(along_m[ahead] - depth_m, 0.0)
    return Hits(robots * ray_x.shape[1] + rays, distance_m, depth_m / radius_m)


def find_nearest(hits: Sequence[Hits], rays: int) -> Tuple[np.ndarray, np.ndarray]:
    """Return distance (m) and cosine of incidence of the first thing on each of so many rays, both (rays,).

    Rays that meet nothing: 1e6 m, 0.
    """
    distance_m, cosine = np.full(rays, _FAR_M), np.zeros(rays)
    for hit in hits:
        np.minimum.at(distance_m, hit.rays, hit.distance_m)
    for hit in hits:
        first = hit.distance_m == distance_m[hit.rays]
        cosine[hit.rays[first]] = hit.cosine[first]
    return distance_m, cosine


def measure_signals(
    places_m: np.ndarray,
    headings: np.ndarray,
    bodies_m: np.ndarray,
    arena: Arena,
    alpha_counts_m2: np.ndarray,
    beta_counts: np.ndarray,
) -> np.ndarray:
    """Return the noiseless signal (counts) of the eight sensors of each robot, shape (R, 8).

    places_m (R, 2) and headings (R, 2), cosine and sine, of the robots that look; bodies_m (R, N, 2) the places of
    the robots that each could see, itself among them; alpha_counts_m2 (R, 8) of each sensor, beta_counts (R, 1) of
    each robot.
    """
    cosine, sine = headings[:, :1], headings[:, 1:]
    ray_x, ray_y = cosine * _RAYS[0] - sine * _RAYS[1], sine * _RAYS[0] + cosine * _RAYS[1]
    circles = arena.circles_m
    to_x_m = np.concatenate((bodies_m[..., 0] - places_m[:, :1], circles[:, 0] - places_m[:, :1]), axis=1)
    to_y_m = np.concatenate((bodies_m[..., 1] - places_m[:, 1:], circles[:, 1] - places_m[:, 1:]), axis=1)
    radii_m = np.concatenate((np.full(bodies_m.shape[1], BODY_RADIUS_M), circles[:, 2]))
    hits = [
        hit_segments(places_m, ray_x, ray_y, arena.segments_m),
        hit_circles(to_x_m, to_y_m, radii_m, ray_x, ray_y),
    ]
    distance_m, incidence = find_nearest(hits, ray_x.size)
    distance_m = np.maximum(distance_m - BODY_RADIUS_M, 1e-3)
    bright = incidence / (distance_m * distance_m)
    bright = (bright.reshape(len(places_m), BEAMS, len(_CONE_RAD)) * _CONE_WEIGHT).max(axis=-1)
    return np.minimum(alpha_counts_m2 * bright + _offset(bright, beta_counts), SATURATION_COUNTS)


def _offset(bright: np.ndarray, beta_counts: np.ndarray) -> np.ndarray:
    """Return the signal's part besides alpha * bright (counts); bright is cosine / distance^2."""
    distance_m = 1.0 / np.sqrt(np.maximum(bright, 1e-12))
    share = np.clip((distance_m - FIT_END_M) / (TABLE_END_M - FIT_END_M), 0.0, 1.0)
    beyond = np.minimum(bright * (TABLE_END_M * TABLE_END_M), 1.0) * TABLE_END_EXCESS_COUNTS
    return beta_counts + share * (beyond - beta_counts)
