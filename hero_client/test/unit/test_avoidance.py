"""Obstacle avoidance by hand-computed commands: how fast, to which side, and for how long."""

import math

import pytest

from hero_client.controllers import avoidance
from hero_client.controllers.avoidance import (
    MAX_DETOUR_RAD_S,
    STOP_STEPS,
    WANDER,
    WanderMemory,
    bend_around,
    split_sectors,
    wander,
)
from hero_node import STOP, Velocity

INF = math.inf
AHEAD = Velocity(0.05, 0.1)


def look(**beams):
    """Return eight ranges; front, left, right, rear and side: those of these beams."""
    ranges = [INF] * 8
    for name, range_m in beams.items():
        ranges[{"front": 0, "left": 1, "side": 2, "rear": 4, "right": 7}[name]] = range_m
    return ranges


def test_a_sector_that_is_not_known_counts_as_an_obstacle():
    assert split_sectors([0.2, 0.3, INF, INF, INF, INF, INF, 0.1]) == (0.3, 0.2, 0.1)
    for index, sector in ((0, 1), (1, 0), (7, 2)):
        ranges = [INF] * 8
        ranges[index] = math.nan
        assert [seen == 0.0 for seen in split_sectors(ranges)] == [one == sector for one in range(3)]


def test_the_drift_of_a_wanderer_is_a_walk_within_its_limit():
    for drift_rad_s, chance, next_rad_s in ((0.0, 0.75, 0.15), (0.4, 0.5, 0.38), (0.6, 1.0, 0.6), (-0.6, 0.0, -0.6)):
        command, memory = wander(look(), WanderMemory(drift_rad_s=drift_rad_s), chance)
        assert command == pytest.approx((WANDER.cruise_m_s, next_rad_s))
        assert memory == pytest.approx((0, 0, next_rad_s))


def test_a_wanderer_slows_down_and_bends_the_nearer_the_more():
    for range_m, speed_m_s, turn_rad_s in ((0.20, 0.1, 0.0), (0.15, 0.05, 0.75), (0.11, 0.02, 1.35), (0.10, 0.02, 1.5)):
        for side, sign in (("right", 1), ("left", -1)):
            command, memory = wander(look(**{side: range_m}), WanderMemory(drift_rad_s=-0.2), 0.5)
            if range_m == WANDER.slow_m:
                assert command == pytest.approx((0.1, -0.19))
                continue
            assert command == pytest.approx((speed_m_s, sign * turn_rad_s))
            assert memory == pytest.approx((0, 0, sign * 0.19)), "it goes on the same way afterwards"
    for drift_rad_s in (0.2, -0.2):  # something straight ahead: on as it turned
        command, _ = wander(look(front=0.15), WanderMemory(drift_rad_s=drift_rad_s), 0.5)
        assert command == pytest.approx((0.05, math.copysign(0.75, drift_rad_s)))


def test_a_blocked_wanderer_stops_then_turns_until_it_sees_far():
    for beams, chance, sign in (
        ({"front": 0.09, "left": 0.2}, 0.9, -1),
        ({"front": 0.09, "right": 0.2}, 0.1, 1),
        ({"front": 0.09}, 0.49, 1),
        ({"front": 0.09}, 0.5, -1),
    ):
        memory = WanderMemory()
        for _ in range(STOP_STEPS):
            command, memory = wander(look(**beams), memory, chance)
            assert command == STOP and memory.escape_sign == sign
        for range_m in (0.09, 0.13, 0.1399):
            command, memory = wander(look(front=range_m), memory, chance)
            assert command == (0.0, sign * WANDER.angular_rad_s)
        command, memory = wander(look(front=0.14), memory, chance)
        assert command.linear_m_s > 0.0 and memory.escape_sign == 0


def test_only_what_is_near_before_the_goal_and_towards_it_bends_the_way():
    for ranges, distance_m, is_bent in (
        (look(front=0.17), 0.5, True),
        (look(front=0.18), 0.5, False),
        (look(front=0.17), 0.16, False),
        (look(side=0.1), 0.5, True),
        (look(rear=0.1), 0.5, False),
        (look(front=math.nan), 0.5, True),
    ):
        command, side = bend_around(AHEAD, 0.0, distance_m, ranges)
        assert (side != 0) == (command != AHEAD) == is_bent


def test_a_detour_is_the_sum_of_goal_push_and_swirl():
    # At 0.115 m, half way: 1.5 * 0.5^2 of the goal's pull; 1.2 times that to the side.
    pull, slide = 1.0 - 0.375, 0.375 * 1.2
    towards_rad, strength = math.atan2(slide, pull), math.hypot(pull, slide)
    expected = (0.08 * math.cos(towards_rad) * strength, 2.0 * towards_rad)
    command, side = bend_around(AHEAD, 0.0, 0.5, look(front=0.115))
    assert side == 1 and command == pytest.approx(expected)
    command, side = bend_around(AHEAD, 0.0, 0.5, look(front=0.115), side=-1)
    assert side == -1 and command == pytest.approx((expected[0], -expected[1])), "the side is kept"
    # 45 degrees to the left: pushes to the right, and along itself to the right, where the goal is.
    command, side = bend_around(AHEAD, 0.0, 0.5, look(left=0.115))
    root = math.sqrt(0.5)
    force_x, force_y = 1.0 - 0.375 * root * (1.0 - 1.2), -0.375 * root * (1.0 + 1.2)
    towards_rad = math.atan2(force_y, force_x)
    assert side == -1
    assert command == pytest.approx(
        (0.08 * math.cos(towards_rad) * min(1.0, math.hypot(force_x, force_y)), 2.0 * towards_rad)
    )
    # The nearest one says on which side to pass.
    assert bend_around(AHEAD, 0.0, 0.5, look(left=0.115, right=0.1))[1] == 1


def test_a_detour_is_limited_and_never_driven_into_what_is_ahead(monkeypatch):
    command, _ = bend_around(AHEAD, 0.0, 0.5, look(front=0.0))
    assert command == (0.0, MAX_DETOUR_RAD_S), "backwards is no way"
    monkeypatch.setattr(avoidance, "PUSH", 0.1)
    for range_m, is_driving in ((0.069, False), (0.071, True)):
        command, _ = bend_around(AHEAD, 0.0, 0.5, look(front=range_m))
        assert (command.linear_m_s > 0.0) == is_driving
