"""Metrics of the published experiments that the suite's own do not have."""

from typing import List, Tuple

import numpy as np

from hero_swarm.metrics import cluster_fraction
from hero_swarm.metrics.graphs import measure_distances
from hero_swarm.metrics.own import State


def touching_fraction(state: State) -> np.ndarray:
    """Return the share of robots in the largest cluster of centers less than 76 mm apart, as of SwarmAggregation."""
    return cluster_fraction(state.poses[..., :2], 0.076)


def chained_clusters(state: State) -> np.ndarray:
    """Return in how many clusters the groups are, as rezeck/segregation counts: chains of nearest robots.

    From the robot that was added last to the nearest one that is left of its group, if that is less than 2 m away; else
    the next cluster begins.
    """
    return _count_clusters(state, 2.0, 1)


def group_clusters(state: State) -> np.ndarray:
    """Return in how many clusters the groups are, of robots at most 0.3 m from another one of their cluster."""
    return _count_clusters(state, 0.3, len(state.poses[0]))


def _count_clusters(state: State, reach_m: float, last: int) -> np.ndarray:
    """Return the clusters of all groups (W,), whose robots are within reach_m of the last added."""
    worlds, robots = state.poses.shape[:2]
    groups = np.asarray(state.memory).reshape(worlds * robots, -1)[:, -1].reshape(worlds, robots)
    counts = np.zeros(worlds)
    for world, (places_m, own) in enumerate(zip(state.poses[..., :2], groups)):
        for group in np.unique(own):
            apart_m = measure_distances(places_m[None, own == group])[0]
            left = list(range(len(apart_m)))
            cluster: List[int] = []
            while left:
                to_m = apart_m[cluster[-last:]][:, left].min(axis=0, initial=np.inf)
                nearest = int(to_m.argmin())
                if to_m[nearest] >= reach_m:
                    counts[world] += 1
                    cluster = []
                cluster.append(left.pop(nearest))
    return counts


def effort(state: State) -> np.ndarray:
    """Return the sum of the amounts of all accelerations along x and y, as rezeck/segregation does."""
    accelerations: np.ndarray = np.abs(state.by_world(state.memory)[..., 2:4]).sum(axis=(1, 2))
    return accelerations


def molecules(state: State) -> np.ndarray:
    """Return how many molecules are complete, as the paper's program counts: also those of two hydrogens."""
    kind, bound, shared = _read_bonds(state)
    is_pair = (kind == 0) & (shared == 1) & (kind[bound[:, 0]] == 0)
    complete = (kind == 1) & (shared == bound.shape[1])
    return state.by_world(complete + 0.5 * is_pair).sum(axis=1)


def missing_bonds(state: State) -> np.ndarray:
    """Return how many bonds robots lack, in all."""
    kind, bound, shared = _read_bonds(state)
    return state.by_world(np.where(kind == 1, bound.shape[1], 1) - shared).sum(axis=1)


def _read_bonds(state: State) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return of each robot its kind (R,), the rows that it binds (R, K), and how many of these bind it, too (R,)."""
    bound, kind = np.asarray(state.memory)[:, 2:-1].astype(int), np.asarray(state.memory)[:, -1].astype(int)
    is_back = (bound[bound] == np.arange(len(bound))[:, None, None]).any(axis=2)
    return kind, bound, ((bound >= 0) & is_back).sum(axis=1)


def on_spot(state: State) -> np.ndarray:
    """Return how many robots are on the first area of the arena."""
    return (state.by_world(state.sensed.floor.area) == 0).sum(axis=1)


def items(state: State) -> np.ndarray:
    """Return how many items were carried to the first area, the nest, from the other ones."""
    areas = state.by_world(state.sensed.floor.area)
    carries = state.kept.get("carries", np.zeros(areas.shape, dtype=bool)) | (areas > 0)
    state.kept["items"] = state.kept.get("items", 0) + (carries & (areas == 0)).sum(axis=1)
    state.kept["carries"] = carries & (areas != 0)
    total: np.ndarray = state.kept["items"]
    return total
