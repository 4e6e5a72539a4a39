"""Metrics by configurations whose values are known."""

import math

import numpy as np
import pytest

from hero_client.values import BODY_RADIUS_M, MODELS
from hero_sim.world.arena import build_rectangle
from hero_swarm import metrics
from hero_swarm.metrics.shapes import ideal_dispersion


def ring(robots, radius_m=0.5):
    angles_rad = 2.0 * math.pi * np.arange(robots) / robots
    return np.column_stack((np.cos(angles_rad), np.sin(angles_rad)))[None] * radius_m, angles_rad


def test_the_ideal_dispersion_is_that_of_the_densest_packing():
    assert ideal_dispersion(1) == 0.0
    for robots, least_m in ((2, 2.0), (3, 2.0 * math.sqrt(3.0)), (4, 2.0 + 2.0 * math.sqrt(3.0))):
        assert ideal_dispersion(robots, 1.0) == pytest.approx(least_m)
    assert ideal_dispersion(7, 1.0) == pytest.approx(12.0)
    assert ideal_dispersion(100, 0.037) == pytest.approx(26.03, rel=0.01)


def test_dispersion_is_the_sum_of_distances_to_the_center():
    places_m, _ = ring(8)
    assert metrics.dispersion(places_m) == pytest.approx([4.0])
    assert metrics.dispersion_ratio(places_m) == pytest.approx([4.0 / ideal_dispersion(8)])


def test_clusters_of_each_world_are_counted_apart():
    gap_m = 4.0 * BODY_RADIUS_M
    near = np.column_stack((np.arange(6) * 0.9 * gap_m, np.zeros(6)))
    split = near + np.where(np.arange(6) < 2, 0.0, 1.0)[:, None]
    assert metrics.cluster_fraction(np.array((near, split, near * 2.0))) == pytest.approx([1.0, 4.0 / 6.0, 1.0 / 6.0])


def test_rotation_is_one_for_a_ring_and_none_for_robots_at_rest_or_opposed():
    places_m, angles_rad = ring(10)
    circling = np.column_stack((-np.sin(angles_rad), np.cos(angles_rad)))[None] * 0.1
    assert metrics.rotation(places_m, circling) == pytest.approx([1.0])
    assert metrics.rotation(places_m, -circling) == pytest.approx([1.0])
    assert metrics.rotation(places_m, 0.0 * circling) == pytest.approx([0.0])
    opposed = circling * np.where(np.arange(10) % 2, 1.0, -1.0)[:, None]
    assert metrics.rotation(places_m, opposed) == pytest.approx([0.0])
    centered_m, moving = np.array([[(1.0, 0.0), (-1.0, 0.0), (0.0, 0.0)]]), np.array([[(0, 1.0), (0, -1.0), (0, 1.0)]])
    assert metrics.rotation(centered_m, moving) == pytest.approx([2.0 / 3.0]), "who is at the center circles nothing"


def test_walls_are_followed_by_those_that_move_along_them():
    arena = build_rectangle(2.0, 2.0, 1)
    places_m = np.array([[(0.9, 0.0), (0.9, 0.0), (0.9, 0.0), (0.9, 0.5), (0.0, 0.0)]])
    speeds_m_s = np.array([[(0.0, 0.05), (0.05, 0.0), (0.0, 0.005), (0.01, -0.05), (0.0, 0.05)]])
    assert metrics.wall_following(places_m, speeds_m_s, arena) == pytest.approx([0.4]), (
        "not at, stuck at or far from them"
    )


def test_a_flock_at_rest_has_no_order():
    headings_rad, moves = np.zeros((1, 4)), np.array([[(0.05, 0.0), (0.0, 0.05), (0.005, 0.005), (0.0, 0.0)]])
    assert metrics.order(headings_rad) == pytest.approx([1.0])
    assert metrics.order(headings_rad, moves) == pytest.approx([0.5])


def test_a_score_begins_at_what_random_controllers_reach():
    chance = metrics.CHANCE["rotation"]
    values = np.array([0.0, chance, (1.0 + chance) / 2.0, 1.0])
    assert metrics.score("rotation", values) == pytest.approx([0.0, 0.0, 0.5, 1.0])


def test_order_and_fatness_have_their_extremes():
    places_m, angles_rad = ring(10)
    assert metrics.order(np.full((1, 5), 2.0)) == pytest.approx([1.0])
    assert metrics.order(angles_rad[None]) == pytest.approx([0.0], abs=1e-9)
    assert metrics.fatness(places_m) == pytest.approx([0.0], abs=1e-9)
    assert metrics.fatness(np.concatenate((places_m, np.zeros((1, 1, 2))), axis=1)) == pytest.approx([1.0])


def test_connectivity_of_a_path_is_the_closed_form_and_zero_if_apart():
    path = np.column_stack((np.arange(5) * 0.1, np.zeros(5)))
    expected = 2.0 * (1.0 - math.cos(math.pi / 5.0))
    apart = path * np.where(np.arange(5) < 3, 1.0, 9.0)[:, None]
    assert metrics.algebraic_connectivity(np.array((path, apart)), 0.15) == pytest.approx([expected, 0.0])


def test_collisions_and_the_nearest_neighbor_ignore_the_robot_itself():
    places_m = np.array([[(0.0, 0.0), (0.07, 0.0), (0.5, 0.0)]])
    assert metrics.collisions(places_m).tolist() == [1]
    for apart_m, collisions in ((2.0 * BODY_RADIUS_M - 1e-6, 1), (2.0 * BODY_RADIUS_M + 1e-6, 0)):
        assert metrics.collisions(np.array([[(0.0, 0.0), (0.0, apart_m)]])).tolist() == [collisions]
    assert metrics.nearest_neighbor(places_m) == pytest.approx([(0.07 + 0.07 + 0.43) / 3.0])


def test_robots_of_another_model_collide_at_their_own_radius():
    radii_m = [MODELS[name].body_radius_m for name in ("hero", "hero_plus", "hero_plus")]
    for gap_m, collisions in ((-1e-6, 2), (1e-6, 0)):
        places_m = np.cumsum([0.0, radii_m[0] + 0.060 + gap_m, 0.120 + gap_m])[:, None] * (1.0, 0.0)
        assert metrics.collisions(places_m[None], radii_m).tolist() == [collisions]
        poses = np.column_stack((places_m, np.zeros(3)))[None]
        assert metrics.METRICS["collisions"](poses, poses, None, radii_m).tolist() == [collisions]


def test_consensus_is_the_spread_about_the_mean():
    assert metrics.consensus_error(np.array([[[0.0], [2.0]], [[5.0], [5.0]]])) == pytest.approx([1.0, 0.0])


def test_one_robot_has_no_area_and_no_connectivity():
    alone = np.array([[(0.3, 0.4, 1.0)], [(0.0, 0.0, 0.0)]])
    assert np.isnan(metrics.METRICS["algebraic_connectivity"](alone)).all()
    assert metrics.METRICS["cluster_fraction"](alone).tolist() == [1.0, 1.0]


OF_OBJECTS = ("object_cluster_fraction", "object_distance")


@pytest.mark.parametrize("name", sorted(set(metrics.METRICS) - set(OF_OBJECTS)))
def test_a_world_with_an_unknown_pose_has_no_value_and_others_keep_theirs(name):
    known = np.array([(0.0, 0.0, 0.0), (0.1, 0.0, 1.0), (0.0, 0.1, 2.0), (0.4, 0.3, 3.0)])
    lost = known.copy()
    lost[1] = math.nan
    velocities = np.full((2, 4, 3), 0.1)
    velocities[1, 1] = math.nan
    around = (None, BODY_RADIUS_M, build_rectangle(1.0, 1.0, 1))
    alone = metrics.METRICS[name](known[None], velocities[:1], *around)
    values = metrics.METRICS[name](np.array((known, lost)), velocities, *around)
    assert values[0] == alone[0] and math.isnan(values[1])
