"""random_walk in virtual time: the robots of eight worlds, each with errors of its own."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
import true_paths
from program_runs import Run

from hero_client.controllers import WanderLaw, WanderMemory
from hero_client.values import BODY_RADIUS_M
from hero_sim.stepped import StepSwarm
from hero_sim.world import build_default, load_arena

pytest.importorskip("rospy", reason="the program imports rospy")
from hero_examples.driving import random_walk
from hero_examples.driving.random_walk import Walker
from hero_test.nonempty import nonempty

WORLDS = 4
ROBOTS = 10
WALK_S = 60.0

CELL_M = 0.2
"""Side of a cell: what one robot with its sensors covers."""


def walk(swarm, duration_s):
    walkers = [Walker(robot, WanderLaw(), seed) for seed, robot in enumerate(swarm)]
    lights = set()

    def step(time_s):
        for walker in walkers:
            assert walker.step() is None
        lights.update(robot.light for robot in swarm)

    return true_paths.run(swarm, step, duration_s), lights


@pytest.mark.slow
def test_walkers_touch_nothing_that_they_see_and_visit_most_cells():
    arena = load_arena("obstacles")
    with StepSwarm(ROBOTS, seed=1, arena="obstacles", worlds=WORLDS) as swarm:
        paths, lights = walk(swarm, WALK_S)
    for path in nonempty(paths):
        assert true_paths.list_touches(path, arena) == []
        assert true_paths.share_visited(path, arena, CELL_M) > 0.8
        assert true_paths.measure_lengths(path).min() > 2.0
    green, yellow, red = (0.0, 1.0, 0.0), (1.0, 1.0, 0.0), (1.0, 0.0, 0.0)
    assert {green, yellow, red} <= lights
    assert true_paths.stop_within(swarm)


@pytest.mark.slow
def test_walkers_keep_a_bump_shield_as_far_away_as_a_stock_body():
    with StepSwarm(4, seed=1, model="hero_plus", worlds=4) as swarm:
        wider_m = swarm.max_body_radius_m - BODY_RADIUS_M
        paths, _ = walk(swarm, 30.0)
    for path in nonempty(paths):
        assert true_paths.measure_gaps(path).min() - 2.0 * wider_m > 0.015
        assert true_paths.measure_wall_gaps(path, build_default(4)).min() - wider_m > 0.04


def test_a_walker_without_usable_ranges_stops_and_says_why():
    with StepSwarm(1) as swarm:
        walker = Walker(swarm[0], WanderLaw())
        true_paths.run(swarm, lambda time_s: walker.step(), 2.0)
        assert swarm[0].velocity.linear_m_s > 0.05
        swarm.rows.set_infrared_calibration(0, np.full(8, math.nan))
        swarm.sleep(0.3)  # the next scan
        path = true_paths.run(swarm, lambda time_s: "not calibrated" not in walker.step(), 2.0)[0]
        assert np.ptp(path[-20:], axis=0).max() < 1e-6
        assert swarm[0].light == (0.0, 0.0, 1.0)


def test_a_walker_that_lost_its_ranges_forgets_where_it_turned():
    sent = []
    robot = SimpleNamespace(
        fresh_proximity=lambda: [math.nan] * 8,
        missing=lambda: "no laser",
        missing_ranges=lambda: "no laser",
        drive=lambda *command: sent.append(command),
        led=sent.append,
    )
    walker = Walker(robot, WanderLaw(), 0)
    walker.memory = WanderMemory(1, 2, 0.3)
    assert walker.step() == "no laser" and sent == [(0.0, 0.0), "blue"]
    assert walker.memory == WanderMemory()


def test_the_program_walks_as_its_parameters_say(monkeypatch):
    commands = []
    for seed in (0, 0, 6):
        with StepSwarm(2, arena="empty", seed=1) as swarm:
            log = swarm.log()
            Run(monkeypatch, random_walk, swarm, 0.6, linear_m_s=0.04, seed=seed)()
            commands.append(log.command[10, 0])
    first, again, other = commands
    assert first[:, 0] == pytest.approx([0.04, 0.04]) and (first == again).all()
    assert (first[:, 1] != other[:, 1]).all() and first[0, 1] != first[1, 1], "each robot has a seed of its own"


def test_the_program_turns_away_as_fast_as_told(monkeypatch):
    with StepSwarm(1) as swarm:
        monkeypatch.setattr(swarm[0], "fresh_proximity", lambda: [0.05, *[math.inf] * 7])
        log = swarm.log()
        Run(monkeypatch, random_walk, swarm, 0.6, angular_rad_s=0.7)()
        assert np.abs(log.command[10, 0, 0]) == pytest.approx((0.0, 0.7))
