"""What robots sense of each other: geometry, limits, and nothing of themselves or of other worlds."""

import math

import numpy as np
import pytest

from hero_client.values.sensing import Binary, Neighbors, list_neighbors, sense_binary, sense_neighbors
from hero_node.robot_constants import BODY_RADIUS_M


class Fixed:
    """Random numbers that are all the same."""

    def __init__(self, value):
        self.value = value

    def random(self, columns=None):
        return np.full(() if columns is None else columns, self.value)

    normal = random


def pair(distance_m, bearing_rad, yaw_rad=0.7):
    """Two robots: the second at a distance and bearing from the first one, turned like it."""
    angle_rad = yaw_rad + bearing_rad
    place_m = (1.0 + distance_m * math.cos(angle_rad), -2.0 + distance_m * math.sin(angle_rad))
    return np.array([[(1.0, -2.0, yaw_rad), (*place_m, yaw_rad)]])


@pytest.mark.parametrize("sensor", [Binary(), Binary(half_angle_rad=0.3), Binary(half_angle_rad=math.pi)])
def test_a_robot_alone_sees_nothing_whatever_its_sensor(sensor):
    assert not sense_binary(np.array([[(0.3, 0.2, 1.0)]]), sensor).any()
    assert not sense_neighbors(np.array([[(0.3, 0.2, 1.0)]]), Neighbors()).seen.any()


def test_a_beam_of_endless_range_touches_a_body_by_its_radius():
    for distance_m in (0.08, 0.5, 50.0):
        edge_rad = math.asin(BODY_RADIUS_M / distance_m)
        for bearing_rad, expected in ((0.0, True), (0.98 * edge_rad, True), (1.02 * edge_rad, False), (math.pi, False)):
            poses = pair(distance_m, bearing_rad)
            assert sense_binary(poses, Binary())[0] == expected, (distance_m, bearing_rad)
            assert not sense_binary(poses, Binary())[1] or bearing_rad == math.pi


def test_compiled_loops_are_told_what_is_computed_here():
    told, poses = [], pair(0.5, 0.25, yaw_rad=0.75)

    def find_touched(places_m, cosine, sine, radius_m, range_m, sees):
        told.append((radius_m, range_m))
        assert places_m.flags.c_contiguous and places_m.tolist() == np.moveaxis(poses[..., :2], 2, 0).tolist()
        assert (cosine.tolist(), sine.tolist()) == (np.cos(poses[..., 2]).tolist(), np.sin(poses[..., 2]).tolist())
        sees[0, 1] = True

    assert sense_binary(poses, Binary(range_m=0.4), find_touched=find_touched).tolist() == [False, True]
    assert told == [(BODY_RADIUS_M, 0.4)]
    sense_binary(poses, Binary(half_angle_rad=0.3), find_touched=find_touched)
    assert len(told) == 1, "for beams alone"


def test_the_robot_behind_sees_the_one_in_front_and_not_the_reverse():
    assert sense_binary(pair(0.5, 0.0), Binary()).tolist() == [True, False]
    assert sense_binary(pair(0.5, math.pi), Binary()).tolist() == [False, True]


def test_range_counts_from_the_front_rim_to_the_surface():
    sensor = Binary(range_m=0.4)
    assert sense_binary(pair(0.4 + 2.0 * BODY_RADIUS_M - 1e-6, 0.0), sensor)[0]
    assert not sense_binary(pair(0.4 + 2.0 * BODY_RADIUS_M + 1e-6, 0.0), sensor)[0]


def test_a_cone_ends_at_its_range_too():
    far_m = 0.4 + 2.0 * BODY_RADIUS_M
    for off_m, is_seen in ((-1e-6, True), (1e-6, False)):
        cone = Binary(half_angle_rad=0.3, range_m=0.4)
        assert sense_binary(pair(far_m + off_m, 0.0), cone)[0] == is_seen


def test_what_is_as_far_as_the_range_is_sensed():
    poses = np.array([[(0.0, 0.0, 0.0), (0.75, 0.0, 0.0)]])
    gap_m = 0.75 - BODY_RADIUS_M - BODY_RADIUS_M
    for range_m, is_seen in ((gap_m, True), (np.nextafter(gap_m, 0.0), False)):
        assert sense_binary(poses, Binary(range_m=range_m))[0] == is_seen
        assert sense_binary(poses, Binary(half_angle_rad=0.3, range_m=range_m))[0] == is_seen
    for range_m, is_seen in ((0.75, True), (np.nextafter(0.75, 0.0), False)):
        assert sense_neighbors(poses, Neighbors(range_m=range_m)).seen[0, 1] == is_seen


def test_a_beam_ends_on_the_round_surface_of_a_body_beside_its_axis():
    left_m = 0.8 * BODY_RADIUS_M
    poses = np.array([[(0.0, 0.0, 0.0), (1.0, left_m, 0.0)]])
    surface_m = 1.0 - 0.6 * BODY_RADIUS_M - BODY_RADIUS_M  # from the front rim
    assert sense_binary(poses, Binary(range_m=surface_m + 1e-6))[0]
    assert not sense_binary(poses, Binary(range_m=surface_m - 1e-6))[0]


def test_a_body_that_touches_the_sensor_is_seen_from_any_side():
    for left_m, ahead_m in ((BODY_RADIUS_M, 0.0), (-BODY_RADIUS_M, 0.0), (0.0, -BODY_RADIUS_M), (0.0, BODY_RADIUS_M)):
        for sensor in (Binary(), Binary(range_m=0.0), Binary(half_angle_rad=0.1, range_m=0.0)):
            poses = np.array([[(0.0, 0.0, 0.0), (BODY_RADIUS_M + ahead_m, left_m, 0.0)]])
            assert sense_binary(poses, sensor)[0], (left_m, ahead_m, sensor)


def test_noise_of_the_bearing_turns_what_is_sensed_and_keeps_its_range():
    sensed = sense_neighbors(pair(0.5, 0.3), Neighbors(bearing_noise_rad=0.1), Fixed(1.0))
    assert sensed.range_m[0, 1] == pytest.approx(0.5)
    assert sensed.bearing_rad[0, 1] == pytest.approx(0.4)


def test_a_cone_sees_a_body_that_reaches_into_it():
    far_m = 10.0
    spread_rad = math.asin(BODY_RADIUS_M / far_m)
    assert sense_binary(pair(far_m, 0.3 + 0.5 * spread_rad), Binary(half_angle_rad=0.3))[0]
    assert not sense_binary(pair(far_m, 0.3 + 1.1 * spread_rad), Binary(half_angle_rad=0.3))[0]


def test_robots_of_another_world_are_not_sensed():
    first, second = pair(0.5, 0.0), pair(0.5, math.pi / 2)
    both = np.concatenate((first, second))
    expected = np.concatenate((sense_binary(first, Binary()), sense_binary(second, Binary())))
    assert sense_binary(both, Binary()).tolist() == expected.tolist() == [True, False, False, False]
    assert sense_neighbors(both, Neighbors()).counts.tolist() == [1, 1, 1, 1]
    assert sense_neighbors(both, Neighbors()).rows.tolist() == [[0, 1], [0, 1], [2, 3], [2, 3]]


def test_a_cone_sees_nothing_beside_and_behind_it():
    cone = Binary(half_angle_rad=0.3)
    for x_m, y_m in ((0.0, -1.0), (0.0, 1.0), (-1.0, -0.1), (-1.0, 0.1), (0.5, -0.5), (0.5, 0.5)):
        assert not sense_binary(np.array([[(0.0, 0.0, 0.0), (x_m, y_m, 0.0)]]), cone)[0]


def test_a_beam_sees_in_a_world_of_many_robots():
    poses = np.column_stack((np.arange(130.0), np.zeros((130, 2))))[None]
    assert sense_binary(poses, Binary()).tolist() == [True] * 129 + [False]


def test_without_worlds_nothing_is_sensed():
    assert sense_binary(np.empty((0, 3, 3)), Binary()).tolist() == []


def test_permuted_robots_sense_the_same():
    rng = np.random.RandomState(0)
    poses = rng.uniform(-0.5, 0.5, (1, 12, 3)) * (1.0, 1.0, 6.0)
    order = rng.permutation(12)
    sensor = Neighbors(range_m=0.4, field_rad=3.0, occlusion=True)
    assert sense_binary(poses[:, order], Binary()).tolist() == sense_binary(poses, Binary())[order].tolist()
    near, permuted = sense_neighbors(poses, sensor), sense_neighbors(poses[:, order], sensor)
    assert permuted.seen.tolist() == near.seen[order][:, order].tolist()
    assert permuted.range_m == pytest.approx(near.range_m[order][:, order])
    assert near.seen.any() and not near.seen.diagonal().any()


def test_a_neighbor_is_where_its_range_and_bearing_say():
    near = sense_neighbors(pair(0.5, -2.0), Neighbors())
    assert near.range_m[0, 1] == pytest.approx(0.5)
    assert near.bearing_rad[0, 1] == pytest.approx(-2.0)
    assert near.heading_rad[0, 1] == pytest.approx(0.0)
    turned = pair(0.5, 0.0, yaw_rad=3.0)
    turned[0, 1, 2] = -3.0
    assert sense_neighbors(turned, Neighbors()).heading_rad[0, 1] == pytest.approx(2.0 * math.pi - 6.0)


def test_range_and_field_of_view_end_what_is_sensed():
    assert sense_neighbors(pair(0.499, 0.0), Neighbors(range_m=0.5)).seen[0, 1]
    assert not sense_neighbors(pair(0.501, 0.0), Neighbors(range_m=0.5)).seen[0, 1]
    assert sense_neighbors(pair(0.5, 0.49), Neighbors(field_rad=1.0)).seen[0, 1]
    assert not sense_neighbors(pair(0.5, 0.51), Neighbors(field_rad=1.0)).seen[0, 1]


def test_a_sensor_without_settings_has_no_noise_and_sees_through_bodies():
    line = np.array([[(0.0, 0.0, 0.0), (0.5, 0.0, 0.0), (1.0, 0.0, 0.0)]])
    near = sense_neighbors(line, Neighbors(), Fixed(0.0))
    assert near.counts.tolist() == [2, 2, 2] and near.range_m[0].tolist() == [0.0, 0.5, 1.0]
    assert near.average(np.array([(9.0, 1.0, 4.0), (1.0, 9.0, 2.0), (0.0, 0.0, 9.0)])).tolist() == [2.5, 1.5, 0.0]
    nothing = sense_neighbors(line, Neighbors(range_m=0.1))
    assert nothing.average(np.ones((3, 3))).tolist() == [0.0] * 3
    worlds = np.concatenate((line, line))
    assert sense_neighbors(worlds, Neighbors()).rows.tolist() == [[0, 1, 2]] * 3 + [[3, 4, 5]] * 3


def test_what_a_sensor_does_not_have_draws_no_random_numbers():
    poses = pair(0.5, 0.0)
    assert sense_binary(poses, Binary(), object())[0]
    assert sense_neighbors(poses, Neighbors(), object()).counts.tolist() == [1, 1]


def test_a_body_between_two_robots_hides_them_from_each_other():
    for ahead, across in ((1.0, 0.0), (0.6, 0.8), (-0.28, 0.96)):
        line = np.array([[(0.0, 0.0, 0.0), (0.3 * ahead, 0.3 * across, 0.0), (0.6 * ahead, 0.6 * across, 0.0)]])
        assert sense_neighbors(line, Neighbors(occlusion=True)).counts.tolist() == [1, 2, 1]
        line[0, 1, :2] += 1.01 * BODY_RADIUS_M * np.array((-across, ahead))
        assert sense_neighbors(line, Neighbors(occlusion=True)).counts.tolist() == [2, 2, 2]


def test_a_robot_without_a_pose_senses_nothing_and_is_not_sensed():
    poses = np.array([[(0.0, 0.0, 0.0), (0.3, 0.0, math.pi), (np.nan, np.nan, np.nan)]])
    assert sense_binary(poses, Binary()).tolist() == [True, True, False]
    assert sense_binary(poses, Binary(error=0.5), Fixed(0.0)).tolist() == [False, False, False]
    assert sense_neighbors(poses, Neighbors(occlusion=True)).counts.tolist() == [1, 1, 0]


@pytest.mark.slow
def test_errors_drop_outs_and_noise_are_as_often_as_they_should_be():
    rng = np.random.RandomState(0)

    class Drawn:
        def random(self, columns=1):
            return rng.random_sample((2, columns)).squeeze()

        def normal(self, columns):
            return rng.standard_normal((2, columns))

    poses, drawn = pair(0.5, 0.0), Drawn()
    wrong = [sense_binary(poses, Binary(error=0.2), drawn)[0] for _ in range(2000)].count(False)
    assert 320 < wrong < 480
    sensor = Neighbors(dropout=0.3, range_noise_m=0.02, bearing_noise_rad=0.1)
    found = [sense_neighbors(poses, sensor, drawn) for _ in range(2000)]
    ranges_m = np.array([near.range_m[0, 1] for near in found if near.seen[0, 1]])
    assert 1300 < len(ranges_m) < 1500
    assert np.std(ranges_m) == pytest.approx(0.02, rel=0.1)
    assert np.std([near.bearing_rad[0, 1] for near in found if near.seen[0, 1]]) == pytest.approx(0.1, rel=0.1)


def test_neighbors_are_listed_nearest_first_under_their_ids():
    poses = np.array([[(0.0, 0.0, 0.0), (0.4, 0.0, 1.0), (-0.2, 0.0, 0.0), (0.0, 0.1, 0.0)]])
    near = sense_neighbors(poses, Neighbors(range_m=0.3))
    found = list_neighbors(near, 0, (7, 8, 9, 10))
    assert [neighbor.robot_id for neighbor in found] == [10, 9]
    assert [neighbor.range_m for neighbor in found] == pytest.approx([0.1, 0.2])
    assert [neighbor.bearing_rad for neighbor in found] == pytest.approx([math.pi / 2.0, math.pi])
