import math

import numpy as np
import pytest

from hero_sim.world import world as worlds
from hero_sim.world.arena import build_default, place_robots
from hero_sim.world.body import Body, SharedReadings
from hero_sim.world.kinematics import split_to_wheels
from hero_sim.world.robot_errors import MAX_WHEEL_M_S, SERVO_LAG_S, draw_errors


def build_world(robots=1, arena=None, errors=0.0, poses=None, seed=0):
    arena = arena or build_default(robots)
    if poses is None:
        poses = place_robots(arena, robots, np.random.RandomState(seed))
    drawn = draw_errors([np.random.RandomState([seed, index]) for index in range(robots)], errors)
    return worlds.World(arena, np.array(poses, dtype=float), [np.random.RandomState(seed)], drawn)


def command(world, index, linear_m_s, turn_rad_s):
    """Give servo pulses without a controller: speeds follow the motor's lag alone."""
    world.commands_m_s[index] = split_to_wheels(linear_m_s, turn_rad_s)


def run(world, seconds):
    for _ in range(int(round(seconds * 1000 / worlds.STEP_MS))):
        world.step()


def test_a_wheel_answers_a_step_like_a_first_order_lag():
    world = build_world()
    command(world, 0, 0.1, 0.0)
    for step in range(1, 40):
        world.step()
        expected_m_s = 0.1 * (1.0 - math.exp(-step * worlds.STEP_MS / 1000.0 / SERVO_LAG_S))
        assert world.speeds_m_s[0] == pytest.approx([expected_m_s] * 2, rel=1e-6)


def test_a_straight_line_is_as_long_as_the_wheels_rolled():
    world = build_world()
    command(world, 0, 0.1, 0.0)
    run(world, 4.0)
    # The lag costs its time constant times the speed, and a step that starts from rest one step more.
    assert world.poses[0, 0] == pytest.approx(0.1 * (4.0 - SERVO_LAG_S), abs=1.5e-3)
    assert world.poses[0, 1:] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert world.travels_m[0] == pytest.approx([world.poses[0, 0]] * 2)


def test_a_circle_has_the_radius_of_speed_over_turn_rate():
    world = build_world()
    world.speeds_m_s[0] = world.commands_m_s[0] = split_to_wheels(0.1, 0.5)
    points = []
    for _ in range(1257):
        world.step()
        points.append(world.poses[0, :2].copy())
    distance_m = np.hypot(*(np.array(points) - (0.0, 0.2)).T)
    assert distance_m == pytest.approx(np.full(1257, 0.2), abs=1e-4)


def test_a_spin_stays_on_the_spot():
    world = build_world()
    command(world, 0, 0.0, 3.0)
    run(world, 3.0)
    assert world.poses[0, :2] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert world.poses[0, 2] == pytest.approx(3.0 * (3.0 - SERVO_LAG_S), abs=0.04)


def test_another_seed_gives_another_path():
    paths = []
    for seed in (1, 2):
        world = build_world(1, errors=1.0, seed=seed)
        world.commands_m_s[:] = 0.1
        run(world, 3.0)
        paths.append(world.poses.tolist())
    assert paths[0] != paths[1]


def test_reading_wheels_within_a_step_meets_the_end_of_the_step():
    world = build_world()
    command(world, 0, 0.2, 0.0)
    run(world, 0.2)
    foreseen_m = Body(world, 0, SharedReadings(world)).read_wheels(world.time_ms + worlds.STEP_MS)
    world.step()
    assert Body(world, 0, SharedReadings(world)).travels_m == pytest.approx(foreseen_m)


def test_pulses_written_to_all_robots_at_once_are_those_of_each_alone():
    together, alone = build_world(9, errors=1.0), build_world(9, errors=1.0)
    pulses_us = np.random.RandomState(0).randint(1000, 2001, (9, 2))
    is_odd = np.arange(9) % 2 == 1
    for which in (is_odd, ~is_odd):
        together.write_pulses(which, np.where(which, pulses_us.T, 1000))
    for row in range(9):
        Body(alone, row, SharedReadings(alone)).write_pulses(*pulses_us[row].tolist())
    assert together.commands_m_s.tolist() == alone.commands_m_s.tolist()
    together.release(np.array([2, 5]))
    assert np.nonzero((together.commands_m_s == 0.0).all(axis=1))[0].tolist() == [2, 5]
    assert np.abs(together.commands_m_s).max() == MAX_WHEEL_M_S


def test_random_numbers_are_the_same_however_many_steps_are_drawn_at_once(monkeypatch):
    keys, drawn = np.arange(4, dtype=np.uint64), []
    for cached in (10**6, 100, 1):
        monkeypatch.setattr(worlds, "_CACHED", cached)
        drawn.append(worlds._draw_block(keys, 32, 3))
    assert (drawn[0] == drawn[1]).all() and (drawn[0] == drawn[2]).all() and len(np.unique(drawn[0])) > 100
