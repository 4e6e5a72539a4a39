"""Metrics of where objects are that robots push. Pure: places (W, M, 2) in m; results (W,), nan without objects."""

import numpy as np

from .graphs import cluster_fraction


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
