"""Metrics of who is near whom. Pure: places (W, N, 2) in m; results (W,), nan where a place is not known."""

from typing import Union

import numpy as np

from hero_client.values import BODY_RADIUS_M


def measure_distances(places_m: np.ndarray) -> np.ndarray:
    """Return the distances (W, N, N) of all robots of each world; inf from a robot to itself."""
    apart_m = np.sqrt(((places_m[:, :, None] - places_m[:, None]) ** 2).sum(axis=-1))
    robots = np.arange(places_m.shape[1])
    apart_m[:, robots, robots] = np.inf
    return apart_m


def _if_known(places_m: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return values (W,), nan for worlds with a place that is not known: comparisons would take it for far away."""
    return np.where(np.isnan(places_m).any(axis=(1, 2)), np.nan, values)


def cluster_fraction(places_m: np.ndarray, reach_m: float = 4.0 * BODY_RADIUS_M) -> np.ndarray:
    """Return the share of robots in the largest cluster.

    Two robots belong together if their centers are less than reach_m apart; by default no third robot fits between them
    (M. Gauci et al., Self-organized aggregation without computation, IJRR 2014).
    """
    near = measure_distances(places_m) < reach_m
    labels = np.tile(np.arange(places_m.shape[1]), (len(places_m), 1))
    while True:
        # The smallest number in a cluster spreads to all of it.
        spread = np.minimum(labels, np.where(near, labels[:, None], labels.shape[1]).min(axis=2))
        if (spread == labels).all():
            break
        labels = spread
    sizes = (labels[:, :, None] == labels[:, None]).sum(axis=2).max(axis=1)
    return _if_known(places_m, sizes / places_m.shape[1])


def nearest_neighbor(places_m: np.ndarray) -> np.ndarray:
    """Return the mean distance (m) between the centers of each robot and its nearest neighbor."""
    distances_m: np.ndarray = measure_distances(places_m).min(axis=2).mean(axis=1)
    return distances_m


def algebraic_connectivity(places_m: np.ndarray, reach_m: float) -> np.ndarray:
    """Return the second smallest eigenvalue of the graph of robots less than reach_m apart.

    0 if it falls apart; nan for one robot, which has no such graph.
    """
    if places_m.shape[1] < 2:
        return np.full(len(places_m), np.nan)
    near = (measure_distances(places_m) < reach_m).astype(float)
    laplacian = near.sum(axis=2)[..., None] * np.eye(near.shape[1]) - near
    values: np.ndarray = np.linalg.eigvalsh(laplacian)[:, 1]
    return _if_known(places_m, np.where(values < 1e-9, 0.0, values))


def collisions(
    places_m: np.ndarray, radii_m: Union[float, np.ndarray] = BODY_RADIUS_M, tolerance_m: float = 0.0
) -> np.ndarray:
    """Return how many pairs of robots touch, or are less than tolerance_m apart; radii_m: of the bodies (N,)."""
    radii_m = np.broadcast_to(radii_m, places_m.shape[1])
    touching_m = radii_m[:, None] + radii_m + tolerance_m
    counts: np.ndarray = (measure_distances(places_m) < touching_m).sum(axis=(1, 2)) // 2
    return _if_known(places_m, counts)
