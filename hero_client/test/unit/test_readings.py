"""Messages -> ranges, nearest obstacle, colours; parameters -> ids, goals, start poses."""

import math
from types import SimpleNamespace

import pytest

from hero_client.readings import front_first, nearest_obstacle, parse_color

INF = math.inf


def make_scan(ranges):
    return SimpleNamespace(ranges=ranges, angle_min=-math.pi, angle_increment=2.0 * math.pi / max(1, len(ranges)))


def test_ranges_begin_straight_ahead_and_go_round_counter_clockwise():
    assert front_first(make_scan([0, 1, 2, 3, 4, 5, 6, 7])) == [4, 5, 6, 7, 0, 1, 2, 3]


def test_too_close_is_zero_and_invalid_stays_invalid():
    ranges = front_first(make_scan([INF, INF, INF, INF, -INF, math.nan, INF, INF]))
    assert ranges[0] == 0.0 and math.isnan(ranges[1])


def test_an_empty_scan_has_no_ranges():
    assert front_first(make_scan([])) == []


def test_the_nearest_obstacle_has_its_bearing():
    assert nearest_obstacle([INF, 0.2, INF, INF, INF, INF, INF, 0.1]) == pytest.approx((0.1, -math.pi / 4))
    assert nearest_obstacle([INF] * 8) is None


def test_colours_have_names_or_numbers():
    assert parse_color("red") == (1.0, 0.0, 0.0)
    assert parse_color([0.1, 0.2, 0.3]) == (0.1, 0.2, 0.3)
    for wrong in ("pink-ish", [1, 2], [0, 0, 1.5]):
        with pytest.raises(ValueError):
            parse_color(wrong)
