"""Formations, and who goes where."""

import itertools
import math
import random

import numpy as np
import pytest

from hero_client.apps.formations import assign_goals, place_formation
from hero_node.files import EntryError
from hero_test.checks.bad_yaml import make_bad_yaml


@pytest.mark.slow
def test_goals_are_assigned_with_the_least_sum_of_squares():
    rng = random.Random(3)
    for _ in range(50):
        points = [(rng.random(), rng.random()) for _ in range(9)]
        starts, goals = points[:4], points[4:]

        def cost_m2(order, starts=starts, goals=goals):
            return sum(math.dist(start, goals[index]) ** 2 for start, index in zip(starts, order))

        least_m2 = min(map(cost_m2, itertools.permutations(range(5), 4)))
        assert cost_m2(assign_goals(starts, goals)) == pytest.approx(least_m2)


def test_no_two_of_a_hundred_robots_would_do_better_with_swapped_goals():
    rng = np.random.RandomState(1)
    starts, goals = rng.uniform(-2.0, 2.0, (100, 2)), rng.uniform(-2.0, 2.0, (120, 2))
    order = assign_goals(starts.tolist(), goals.tolist())
    assert len(set(order)) == 100
    apart_m, towards_m = (points[:, None] - points for points in (starts, goals[order]))
    assert (apart_m * towards_m).sum(axis=2).min() > -1e-6, "as of paths that do not meet (CAPT)"
    free = sorted(set(range(120)) - set(order))
    to_free_m = np.hypot(*(starts[:, None] - goals[free]).transpose(2, 0, 1))
    assert (to_free_m > np.hypot(*(starts - goals[order]).T)[:, None] - 1e-9).all()


def test_robots_and_goals_on_one_point_are_assigned():
    assert sorted(assign_goals([(0.0, 0.0)] * 3, [(1.0, 1.0)] * 3)) == [0, 1, 2]
    assert assign_goals([], [(1.0, 1.0)]) == []


def test_paths_to_assigned_goals_do_not_cross():
    assert assign_goals([(0.0, 0.0), (1.0, 0.0)], [(1.0, 1.0), (0.0, 1.0)]) == [1, 0]


def test_more_robots_than_goals_is_an_error():
    with pytest.raises(ValueError, match="3 robots cannot take 2 goals"):
        assign_goals([(0.0, 0.0)] * 3, [(1.0, 1.0)] * 2)


@pytest.mark.parametrize("shape", ["circle", "line", "grid"])
def test_a_formation_has_its_spacing_and_its_center(shape):
    for count in range(1, 13):
        places = place_formation(
            {"shape": shape, "center": [1.0, -2.0], "spacing_m": 0.3, "turn_deg": 30.0}, count, 0.2
        )
        assert len(places) == count
        if count > 1:
            nearest_m = min(math.dist(a, b) for a, b in itertools.combinations(places, 2))
            assert nearest_m == pytest.approx(0.3)
        if shape != "grid" or count in (1, 2, 4, 6, 9, 12):  # whole rows
            assert sum(x for x, _ in places) / count == pytest.approx(1.0)
            assert sum(y for _, y in places) / count == pytest.approx(-2.0)


@pytest.mark.parametrize(
    "formation, says",
    [
        ([], "must be a mapping"),
        ({"shape": "star"}, "shape is 'star'"),
        ({"spacing": 1}, "formation: unknown 'spacing'; allowed are: shape, center"),
        ({"spacing_m": 0.1}, "make spacing_m larger"),
        ({"center": [1]}, r"center is a list, but must be \[x, y\]"),
        ({"turn_deg": True}, "turn_deg is True"),
        ({"shape": "grid", "columns": 0}, "columns is 0"),
        ({"shape": "points", "points": [[0, 0]]}, "at least 3 places"),
        ({"shape": "points", "points": [[0, 0], [0, 0.5], [0, 0.1]]}, "two places are 0.100 m apart"),
        ({"shape": "points", "points": [[0, 0], [0, 0.5], [0, "x"]]}, "points is 'x'"),
    ],
)
def test_a_wrong_formation_is_told_in_one_line(formation, says):
    with pytest.raises(EntryError, match=says) as raised:
        place_formation(formation, 3, 0.2)
    assert "\n" not in str(raised.value)


@pytest.mark.slow
@pytest.mark.parametrize("key", ["shape", "center", "points", "columns", "spacing_m"])
def test_no_formation_breaks_its_reader(key):
    for content in make_bad_yaml(key):
        try:
            place_formation(content.decode("utf-8", "replace") + "\nshape: grid\n" * (key == "columns"), 4, 0.1)
        except EntryError as error:
            assert str(error).isprintable() and len(str(error)) < 400
