"""Metrics of the published experiments that the suite's own do not have."""

from typing import List

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
