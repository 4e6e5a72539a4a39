"""Metrics of the shape of a swarm, or of objects that it pushes. Pure: places (W, N, 2) in m; results (W,)."""

import math
from functools import lru_cache

import numpy as np

from hero_client.values import BODY_RADIUS_M

from .graphs import cluster_fraction


def _distances_from_center(places_m: np.ndarray) -> np.ndarray:
    off_m = places_m - places_m.mean(axis=1, keepdims=True)
    return np.hypot(off_m[..., 0], off_m[..., 1])


def dispersion(places_m: np.ndarray) -> np.ndarray:
    """Return the sum of the distances (m) of all robots from their center."""
    total_m: np.ndarray = _distances_from_center(places_m).sum(axis=1)
    return total_m


@lru_cache(maxsize=None)
def ideal_dispersion(robots: int, radius_m: float = BODY_RADIUS_M) -> float:
    """Return the least dispersion (m) of this many discs: the densest packing, around the best of its centers."""
    reach = math.ceil(math.sqrt(robots)) + 2
    rows, columns = np.meshgrid(np.arange(-reach, reach + 1), np.arange(-reach, reach + 1), indexing="ij")
    lattice = np.column_stack(((columns + rows / 2.0).ravel(), (rows * math.sqrt(0.75)).ravel()))
    # A disc, the middle between two, and the middle between three.
    centers = np.array([(0.0, 0.0), (0.5, 0.0), (0.5, math.sqrt(0.75) / 3.0)])
    sums = [np.sort(np.hypot(*(lattice - center).T))[:robots].sum() for center in centers]
    return float(2.0 * radius_m * min(sums))


def dispersion_ratio(places_m: np.ndarray) -> np.ndarray:
    """Return the dispersion as a multiple of the least possible one."""
    return dispersion(places_m) / ideal_dispersion(places_m.shape[1])


def fatness(places_m: np.ndarray) -> np.ndarray:
    """Return how far robots are from being on one circle around their center: 0 on it, 1 if one is in the middle."""
    distances_m = _distances_from_center(places_m)
    ratio: np.ndarray = distances_m.min(axis=1) / distances_m.max(axis=1)
    return 1.0 - ratio * ratio


def object_cluster_fraction(places_m: np.ndarray, reach_m: float = 0.2) -> np.ndarray:
    """Return the share of objects in the largest cluster.

    Two belong together if their centers are less than reach_m apart: by default two diameters of a disc of 0.1 m, so
    that no third one fits between them (M. Gauci et al., Clustering objects with robots that do not
    compute, AAMAS 2014).
    """
    return cluster_fraction(places_m, reach_m) if places_m.shape[1] else np.full(len(places_m), np.nan)


def object_distance(places_m: np.ndarray) -> np.ndarray:
    """Return the mean distance (m) of the objects' centers from the origin, the goal of behaviors that push them."""
    distances_m = np.hypot(places_m[..., 0], places_m[..., 1])
    return distances_m.mean(axis=1) if places_m.shape[1] else np.full(len(places_m), np.nan)
