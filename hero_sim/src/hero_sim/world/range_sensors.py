"""The signals of each robot's eight infrared sensors, from poses, walls and obstacles; without noise.

Pure: numpy only, over robots x obstacles x rays at once, and the same bits on every machine. Source of the infrared
model: measurements published by the robot's authors (signal of a TCRT5000 against a white wall).
"""

import math
from typing import NamedTuple, Tuple

import numpy as np

from hero_node.robot_constants import BEAMS, BODY_RADIUS_M

from . import ray_loops
from .arena import Segments
from .compiled import compile_loops
from .kinematics import find_heading

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

REACH_M = 0.65
"""Farther than this from a robot's center nothing is looked for: it adds less than the noise of one reading."""

DISTANCE_REACH_M = 4.0
"""Reach of HeRo+'s VL53L1X, which shows this where it sees nothing (assumption)."""

DISTANCE_NOISE_M = 0.005
"""Standard deviation of one of its readings (assumption)."""

# The diode sees a cone, whose rim is modeled by two more rays of less weight. Half angle and weight are assumptions.
_CONE_RAD = np.array([[0.0], [-0.21], [0.21]])
_CONE_WEIGHT = np.array([1.0, 0.7, 0.7])
_RAYS = _RAYS_X, _RAYS_Y = np.array(find_heading((BEAM_ANGLES_RAD + _CONE_RAD).ravel()))
"""Directions of all rays in the body frame (A,): those of the cones' middles come first."""

_FAR_M = 1e6

_LIMITS_M = REACH_M, _FAR_M, BODY_RADIUS_M


class Sight(NamedTuple):
    """Robots, with the walls and obstacles that they may see.

    Attributes:
        places_m (K, 2), headings (K, 2): of the robots that look; headings are cosine and sine.
        bodies_m (K, N, 2): of the robots that each could see, itself among them; radii_m (N,) theirs.
        walls: all walls.
        circles_m (C, 3): x, y, radius.
    """

    places_m: np.ndarray
    headings: np.ndarray
    bodies_m: np.ndarray
    radii_m: np.ndarray
    walls: Segments
    circles_m: np.ndarray


def measure_signals(sight: Sight, alpha_counts_m2: np.ndarray, beta_counts: np.ndarray) -> np.ndarray:
    """Return the noiseless signal (counts) of the eight sensors of each robot, shape (K, 8).

    alpha_counts_m2 (K, 8) of each sensor, beta_counts (K, 1) of each robot.
    """
    bright = _measure_brightness(sight)
    distance_m = 1.0 / np.sqrt(np.maximum(bright, 1e-12))
    share = np.minimum(np.maximum((distance_m - FIT_END_M) / (TABLE_END_M - FIT_END_M), 0.0), 1.0)
    beyond = np.minimum(bright * (TABLE_END_M * TABLE_END_M), 1.0) * TABLE_END_EXCESS_COUNTS
    return np.minimum(alpha_counts_m2 * bright + (beta_counts + share * (beyond - beta_counts)), SATURATION_COUNTS)


def _measure_brightness(sight: Sight) -> np.ndarray:
    """Return cosine / distance^2 (1/m^2) of what the eight sensors of each robot see, shape (K, 8)."""
    loops = compile_loops(ray_loops, len(sight.places_m))
    if loops is not None:
        places_m, headings, bodies_m, radii_m, walls, circles_m = sight
        brightest = np.empty((len(places_m), BEAMS))
        loops.measure_brightness(
            places_m, headings, bodies_m, radii_m, *walls, circles_m, _RAYS, _CONE_WEIGHT, _LIMITS_M, brightest
        )
        return brightest
    cosine, sine = sight.headings[:, :1], sight.headings[:, 1:]
    met_m, incidence = meet_first(cosine * _RAYS_X - sine * _RAYS_Y, sine * _RAYS_X + cosine * _RAYS_Y, sight, REACH_M)
    gap_m = np.maximum(met_m - BODY_RADIUS_M, 1e-3)
    bright = (incidence / (gap_m * gap_m)).reshape(-1, len(_CONE_RAD), BEAMS) * _CONE_WEIGHT[:, None]
    return np.maximum.reduce(bright, axis=1)


def measure_distances(sight: Sight) -> np.ndarray:
    """Return how far (m) ahead of each robot's center something is (K,), DISTANCE_REACH_M at most."""
    met_m, _ = meet_first(sight.headings[:, :1], sight.headings[:, 1:], sight, DISTANCE_REACH_M)
    return np.minimum(met_m[:, 0], DISTANCE_REACH_M)


def meet_first(x: np.ndarray, y: np.ndarray, sight: Sight, reach_m: float) -> Tuple[np.ndarray, np.ndarray]:
    """Return how far the first thing on each ray is from the robot's center, and the cosine of the incidence (K, A).

    x, y (K, A): directions of the rays, A of each robot. Nothing is looked for beyond reach_m: 1e6 m, 0. A circle
    around the robot's own center, its body, is not seen. Of equally far things the first one counts, walls before all.
    """
    x, y, places_m = x[:, None], y[:, None], sight.places_m.T[..., None]
    (start_x, start_y), (along_x, along_y) = sight.walls.start_m[:, None] - places_m, sight.walls.along_m
    area_m2, length_m2 = start_x * along_y - start_y * along_x, sight.walls.length_m2
    is_near = area_m2 * area_m2 < (reach_m * reach_m) * length_m2
    area_m2 = area_m2[..., None]
    cross, across_m2 = x * along_y[:, None] - y * along_x[:, None], start_x[..., None] * y - start_y[..., None] * x
    meets = (area_m2 * cross > 0.0) & (across_m2 * cross >= 0.0) & (np.abs(across_m2) <= np.abs(cross))
    meets &= is_near[..., None]
    walls_m = np.divide(area_m2, cross, out=np.full(cross.shape, _FAR_M), where=meets)
    robots, (circles_x, circles_y, circles_radii_m) = len(sight.places_m), sight.circles_m.T
    to_x, to_y = (
        np.hstack((sight.bodies_m[..., axis], np.broadcast_to(circles, (robots, len(circles))))) - places_m[axis]
        for axis, circles in enumerate((circles_x, circles_y))
    )
    radii_m = np.concatenate((sight.radii_m, circles_radii_m))
    center_m2, radii_m2 = to_x * to_x + to_y * to_y, (radii_m * radii_m)[:, None]
    is_near = (center_m2 > 0.0) & (center_m2 < (reach_m + radii_m) * (reach_m + radii_m))
    across_m, along_m = x * to_y[..., None] - y * to_x[..., None], x * to_x[..., None] + y * to_y[..., None]
    meets = (across_m * across_m < radii_m2) & (along_m > 0.0) & is_near[..., None]
    depth_m = np.sqrt(np.maximum(radii_m2 - across_m * across_m, 0.0))
    all_m = np.hstack((walls_m, np.where(meets, np.maximum(along_m - depth_m, 0.0), _FAR_M), np.full(x.shape, _FAR_M)))
    slants = np.hstack((np.abs(cross) / np.sqrt(length_m2)[:, None], depth_m / radii_m[:, None], np.zeros(x.shape)))
    first = all_m.argmin(axis=1)[:, None]
    met_m = np.take_along_axis(all_m, first, axis=1)[:, 0]
    return met_m, np.take_along_axis(slants, first, axis=1)[:, 0] * (met_m < _FAR_M)
