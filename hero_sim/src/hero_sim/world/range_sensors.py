"""The signals of each robot's eight infrared sensors, from poses, walls and obstacles; without noise.

Pure: numpy only, over robots x obstacles x rays at once, and the same bits on every machine. Source of the infrared
model: measurements published by the robot's authors (signal of a TCRT5000 against a white wall).
"""

import math
from typing import NamedTuple

import numpy as np

from ..robot_constants import BODY_RADIUS_M
from . import ray_loops
from .arena import Segments
from .compiled import compile_loops
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


class Rays:
    """The rays of some robots, A of each, in the world, and what they have met so far.

    Attributes:
        x, y: directions (K, A).
        distance_m: of the first thing on each ray from the robot's center (K, A); 1e6 if there is none.
        cosine: of the angle of incidence on it (K, A).
    """

    def __init__(self, x: np.ndarray, y: np.ndarray, reach_m: float = REACH_M) -> None:
        """Begin with rays that have met nothing, and look for nothing beyond reach_m from the robot's center."""
        self.x, self.y, self._reach_m = x, y, reach_m
        self.distance_m, self.cosine = np.full(x.shape, _FAR_M), np.zeros(x.shape)

    def meet_walls(self, x_m: np.ndarray, y_m: np.ndarray, walls: Segments) -> None:
        """Cut rays from x_m and y_m (K, 1), which have met nothing yet, at walls."""
        start_x, start_y = walls.start_m[0] - x_m, walls.start_m[1] - y_m
        area_m2 = start_x * walls.along_m[1] - start_y * walls.along_m[0]
        robots, seen = (area_m2 * area_m2 < (self._reach_m * self._reach_m) * walls.length_m2).nonzero()
        if not len(robots):
            return
        ray_x, ray_y = self.x[robots], self.y[robots]
        start_x, start_y, area_m2 = (array[robots, seen, None] for array in (start_x, start_y, area_m2))
        along_x, along_y = walls.along_m[:, seen, None]
        length_m2 = walls.length_m2[seen, None]
        cross, across_m2 = ray_x * along_y - ray_y * along_x, start_x * ray_y - start_y * ray_x
        meets = (area_m2 * cross > 0.0) & (across_m2 * cross >= 0.0) & (np.abs(across_m2) <= np.abs(cross))
        distance_m = np.divide(area_m2, cross, out=np.full(cross.shape, _FAR_M), where=meets)
        # The walls that one robot sees follow each other.
        first = np.concatenate(([True], robots[1:] != robots[:-1])).nonzero()[0]
        self.distance_m[robots[first]] = np.minimum.reduceat(distance_m, first)
        nearest = meets & (distance_m == self.distance_m[robots])
        cosine = np.where(nearest, np.abs(cross) / np.sqrt(length_m2), 0.0)
        self.cosine[robots[first]] = np.maximum.reduceat(cosine, first)

    def meet_circles(self, to_x_m: np.ndarray, to_y_m: np.ndarray, radii_m: np.ndarray) -> None:
        """Cut rays at circles (C,) whose centers are to_x_m and to_y_m (K, C) from the robots'.

        A circle around the robot's own center, its body, is not seen.
        """
        center_m2, reach_m = to_x_m * to_x_m + to_y_m * to_y_m, self._reach_m + radii_m
        robots, circles = ((center_m2 < reach_m * reach_m) & (center_m2 > 0.0)).nonzero()
        if not len(robots):
            return
        x, y, radius_m = self.x[robots], self.y[robots], radii_m[circles]
        to_x_m, to_y_m = to_x_m[robots, circles], to_y_m[robots, circles]
        across_m = x * to_y_m[:, None] - y * to_x_m[:, None]
        pairs, rays = (across_m * across_m < (radius_m * radius_m)[:, None]).nonzero()
        along_m = x[pairs, rays] * to_x_m[pairs] + y[pairs, rays] * to_y_m[pairs]
        front = along_m > 0.0
        pairs, rays, along_m = pairs[front], rays[front], along_m[front]
        across_m, radius_m, robots = across_m[pairs, rays], radius_m[pairs], robots[pairs]
        depth_m = np.sqrt(radius_m * radius_m - across_m * across_m)
        distance_m = np.maximum(along_m - depth_m, 0.0)
        np.minimum.at(self.distance_m, (robots, rays), distance_m)
        nearest = distance_m == self.distance_m[robots, rays]
        self.cosine[robots[nearest], rays[nearest]] = (depth_m / radius_m)[nearest]


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
    rays = Rays(cosine * _RAYS_X - sine * _RAYS_Y, sine * _RAYS_X + cosine * _RAYS_Y)
    _meet_all(rays, sight)
    distance_m = np.maximum(rays.distance_m - BODY_RADIUS_M, 1e-3)
    bright = rays.cosine / (distance_m * distance_m)
    weighed = bright.reshape(-1, len(_CONE_RAD), BEAMS) * _CONE_WEIGHT[:, None]
    return np.maximum.reduce(weighed, axis=1)


def measure_distances(sight: Sight) -> np.ndarray:
    """Return how far (m) ahead of each robot's center something is (K,), DISTANCE_REACH_M at most."""
    rays = Rays(sight.headings[:, :1], sight.headings[:, 1:], DISTANCE_REACH_M)
    _meet_all(rays, sight)
    return np.minimum(rays.distance_m[:, 0], DISTANCE_REACH_M)


def _meet_all(rays: Rays, sight: Sight) -> None:
    x_m, y_m = sight.places_m[:, :1], sight.places_m[:, 1:]
    rays.meet_walls(x_m, y_m, sight.walls)
    rays.meet_circles(sight.bodies_m[..., 0] - x_m, sight.bodies_m[..., 1] - y_m, sight.radii_m)
    if len(sight.circles_m):
        circles_m = sight.circles_m
        rays.meet_circles(circles_m[:, 0] - x_m, circles_m[:, 1] - y_m, circles_m[:, 2])
