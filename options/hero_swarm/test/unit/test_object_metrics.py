"""Metrics of where objects are, and how they are scattered."""

import numpy as np
import pytest

from hero_client.values import BODY_RADIUS_M
from hero_sim.world import load_arena
from hero_swarm import metrics
from hero_swarm.trial import scatter_objects


def test_metrics_of_objects_count_clusters_and_distances():
    objects = np.array([[(0.0, 0.0, 0.0), (0.19, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]])
    none = np.empty((1, 1, 3))
    assert metrics.METRICS["object_cluster_fraction"](none, none, objects) == [0.5]
    assert metrics.METRICS["object_distance"](none, none, objects) == pytest.approx(2.19 / 4.0)
    for name in ("object_cluster_fraction", "object_distance"):
        assert np.isnan(metrics.METRICS[name](none, none, objects[:, :0])).tolist() == [True]


def test_scattered_objects_differ_by_seed_and_overlap_nothing():
    arena, robots = load_arena("discs"), np.zeros((1, 3))
    places_m = [np.array([thing.pose[:2] for thing in scatter_objects(arena, robots, seed)]) for seed in (1, 1, 2)]
    assert (places_m[0] == places_m[1]).all() and (places_m[0] != places_m[2]).any()
    apart_m = np.hypot(*np.moveaxis(places_m[2][:, None] - places_m[2], -1, 0)) + np.eye(20)
    assert apart_m.min() > 0.1 and np.hypot(*places_m[2].T).min() > 0.05 + BODY_RADIUS_M
    assert np.abs(places_m[2]).max() < 1.45
