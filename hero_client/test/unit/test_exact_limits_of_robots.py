"""Limits of robots, swarms and their programs at their very values, which random cases never meet."""

import math

import numpy as np
import pytest
from linkless_robot import FakeSwarm, make_robot

from hero_client.apps.formations import assign_goals, place_formation
from hero_client.apps.teleop_output import PAUSE_S, PauseDetector
from hero_client.controllers.motion import SILENT_STEPS
from hero_client.controllers.orca import AvoidanceLaw
from hero_client.robots.group import READY_TIMEOUT_S
from hero_client.robots.light import MIN_BLINK_PERIOD_S
from hero_client.robots.robot_base import WARNING_PERIOD_S
from hero_client.robots.swarm_base import FIRST_REPORT_S, REPORT_PERIOD_S
from hero_client.values.errors import GoalError, RobotNotReadyError, StaleDataError, StoppedError
from hero_client.values.readings import FRESH_S
from hero_node import Pose
from hero_node.files import EntryError
from hero_node.robot_constants import MAX_ANGULAR_RAD_S, MAX_LINEAR_M_S


def above(value):
    return float(np.nextafter(value, np.inf))


def test_data_are_fresh_up_to_a_second():
    for age_s, is_fresh in ((FRESH_S, True), (above(FRESH_S), False)):
        robot, link = make_robot()
        link.silent_s.update(odom=age_s, proximity=age_s)
        assert (robot.fresh_pose() is not None) == (robot.fresh_velocity() is not None) == is_fresh
        assert math.isnan(robot.fresh_proximity()[0]) != is_fresh
        assert (robot.missing_ranges() is None) == is_fresh
        robot, link = make_robot()
        link.silent_s["proximity"], link.ranges[:] = age_s, [math.nan] * 8
        robot.forward(0.01)
        assert any("does not see what is in its way" in text for text in link.warned) == is_fresh
        link.silent_s["odom"] = age_s
        for name in ("pose", "velocity", "proximity"):
            if is_fresh:
                assert getattr(robot, name) is not None
            else:
                with pytest.raises(StaleDataError):
                    getattr(robot, name)


def test_a_robot_is_connecting_in_its_first_two_seconds():
    for after_s, is_first in ((0.5, True), (READY_TIMEOUT_S, False)):
        robot, link = make_robot()
        link.ready_s, link.silent_s["odom"] = math.inf, math.inf
        link.clock.now_s = robot._first_data_s - READY_TIMEOUT_S + after_s
        assert ("connecting" in repr(robot)) == is_first
        robot.await_first("odom")
        assert bool(link.waited) == is_first


def test_the_fastest_speeds_and_the_shortest_times_are_taken():
    robot, link = make_robot()
    robot.drive(MAX_LINEAR_M_S, -MAX_ANGULAR_RAD_S)
    assert link.warned == [] and link.sent[-1][1:] == (MAX_LINEAR_M_S, -MAX_ANGULAR_RAD_S)
    robot.drive(0.1, 0.0, duration_s=0.0)
    robot.blink("red", MIN_BLINK_PERIOD_S)
    assert [sent[1:] for sent in link.sent[1:]] == [(0.0, 0.0)], "a stop alone"
    for speeds in ((above(MAX_LINEAR_M_S), 0.0), (0.0, -above(MAX_ANGULAR_RAD_S))):
        robot, link = make_robot()
        robot.drive(*speeds)
        assert len(link.warned) == 1


def test_warnings_and_reports_come_again_once_their_period_has_passed():
    robot, link = make_robot()
    link.is_stopped = True
    for now_s in (100.0, 100.0 + WARNING_PERIOD_S - 0.125, 100.0 + WARNING_PERIOD_S):
        link.clock.now_s = now_s
        robot.drive(0.1, 0.0)
    assert len(link.warned) == 2
    swarm = FakeSwarm(0)
    for after_s in (FIRST_REPORT_S - 0.125, FIRST_REPORT_S, FIRST_REPORT_S + REPORT_PERIOD_S):
        swarm._clock.now_s = 100.0 + after_s
        swarm.report_missing({"hero_0": "away"})
    assert [time_s for time_s, _, _ in swarm.logged] == [FIRST_REPORT_S, FIRST_REPORT_S + REPORT_PERIOD_S]


def test_a_robot_that_is_ready_at_the_last_moment_is_ready():
    for ready_s, is_in_time in ((1.0, True), (1.01, False)):
        robot, link = make_robot()
        link.ready_s = 100.0 + ready_s
        if is_in_time:
            assert robot.wait_until_ready(1.0) is robot
        else:
            with pytest.raises(RobotNotReadyError, match="not ready after 1 s"):
                robot.wait_until_ready(1.0)


def test_robots_without_a_goal_may_be_as_near_as_their_spacing():
    spacing_m = AvoidanceLaw().min_spacing_m
    for apart_m, is_refused in ((spacing_m, False), (spacing_m - 1e-9, True)):
        swarm = FakeSwarm(0, 1)
        swarm.links[1].origin = Pose(apart_m, 0.0, 0.0)
        if is_refused:
            with pytest.raises(GoalError, match="robots need"):
                swarm.go_to_each({0: (0.0, 0.0)}, frame="world")
        else:
            swarm.go_to_each({0: (0.0, 0.0)}, frame="world")


def test_goals_of_a_swarm_end_in_time_and_after_20_steps_without_a_pose():
    swarm = FakeSwarm(0)
    with pytest.raises(GoalError, match="not there after 1 s"):
        swarm.go_to_each({0: (9.0, 0.0)}, frame="world", timeout_s=1.0)
    assert swarm.now_s - 100.0 == pytest.approx(1.2, abs=0.11), "its stops take 0.1 s"
    swarm, steps = FakeSwarm(0), []
    link = swarm.links[0]
    link.advance = lambda step_s: link.silent_s.update(odom=9.0)
    swarm.step_to_goals = lambda *arguments: steps.append(1) or FakeSwarm.step_to_goals(swarm, *arguments)
    with pytest.raises(GoalError, match="no pose for 2 s"):
        swarm.go_to_each({0: (9.0, 0.0)}, frame="world")
    assert len(steps) == SILENT_STEPS + 1, "the first one had a pose"


def test_the_error_of_one_robot_is_told_as_it_is_and_of_two_in_one():
    swarm = FakeSwarm(0, 1, 2)
    swarm.links[1].is_stopped = True
    with pytest.raises(StoppedError, match="hero_1 does not move"):
        swarm.forward(0.1)
    swarm.links[2].is_stopped = True
    with pytest.raises(GoalError, match="hero_1 does not move.*; hero_2 does not move"):
        swarm.forward(0.1)


def test_places_of_a_formation_may_be_as_near_as_robots_need():
    for spacing_m, is_refused in ((0.25, False), (0.2499, True)):
        formation = {"shape": "line", "spacing_m": spacing_m}
        if is_refused:
            with pytest.raises(EntryError, match="make spacing_m larger"):
                place_formation(formation, 2, 0.25)
        else:
            assert place_formation(formation, 2, 0.25) == [(-0.125, 0.0), (0.125, 0.0)]
    points = {"shape": "points", "points": [[0, 0], [1, 0]]}
    assert len(place_formation(points, 2, 0.25)) == 2
    with pytest.raises(EntryError, match="at least 3 places"):
        place_formation(points, 3, 0.25)
    assert assign_goals([(0.0, 0.0), (1.0, 0.0)], [(1.0, 0.0), (0.0, 0.0)]) == [1, 0]
    assert assign_goals([(0.0, 0.0)] * 2, [(1.0, 0.0)] * 2) in ([0, 1], [1, 0]), "no swap helps"


def test_half_a_second_without_a_step_is_no_pause():
    pauses = PauseDetector(10.0)
    assert not pauses.is_paused(10.0 + PAUSE_S) and pauses.is_paused(above(10.0 + PAUSE_S))
