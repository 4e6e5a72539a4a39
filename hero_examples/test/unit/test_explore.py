"""explore in virtual time: robots share out frontiers, go there, and walk at random there."""

import math

import pytest
import true_paths

from hero_client import CommonFrame
from hero_client.controllers import State
from hero_client.values.readings import NOT_CALIBRATED
from hero_node import Pose, transform_pose
from hero_sim.stepped import StepSwarm

pytest.importorskip("rospy", reason="the program imports rospy")
from hero_examples.swarm import explore as explore_program
from hero_examples.swarm.explore import NEAR_M, Explorer, explore_together

GREEN, YELLOW = (0.0, 1.0, 0.0), (1.0, 1.0, 0.0)
STARTS = """
walls_m: [[[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]]
starts_m_deg: [[-0.1, 0, 90], [0.1, 0, 90]]
"""
LEFT, RIGHT = (-0.7, 0.0), (0.7, 0.1)


@pytest.fixture()
def swarm(tmp_path):
    arena = tmp_path / "arena.yaml"
    arena.write_text(STARTS)
    with StepSwarm(2, seed=1, arena=str(arena)) as swarm:
        yield swarm


def explore(swarm, frontiers, duration_s, frame="map"):
    """Explore while the map ends at these places; return the explorers and the robots' paths."""
    explorers = [Explorer(robot, CommonFrame(frame), seed=robot.robot_id) for robot in swarm]
    path = true_paths.run(swarm, lambda time_s: explore_together(explorers, frontiers, time_s), duration_s)[0]
    return explorers, path


def test_each_robot_takes_the_nearest_place_that_no_other_has(swarm):
    explorers, _ = explore(swarm, [LEFT, RIGHT], 1.5)
    assert [explorer.goal for explorer in explorers] == [LEFT, RIGHT]
    assert {robot.light for robot in swarm} == {GREEN}


@pytest.mark.slow
def test_robots_get_to_where_the_map_ends_and_walk_at_random_there(swarm):
    _, path = explore(swarm, [LEFT, RIGHT], 9.0)
    for robot, place in zip(range(2), (LEFT, RIGHT)):
        assert min(math.dist(pose[:2], place) for pose in path[:, robot]) < NEAR_M
    assert {robot.light for robot in swarm} == {YELLOW}


def test_a_single_place_is_one_robots_goal_and_the_other_walks(swarm):
    explorers, path = explore(swarm, [LEFT], 1.5)
    assert [explorer.goal for explorer in explorers] == [LEFT, None]
    assert true_paths.measure_lengths(path)[1] > 0.05


def test_robots_whose_place_is_not_known_stop_and_are_named(swarm):
    explorers, path = explore(swarm, [LEFT, RIGHT], 1.0, frame="nowhere")
    assert true_paths.measure_lengths(path).max() < 0.001
    assert "nowhere" in explorers[0].common.missing["hero_0"]


def test_of_places_that_were_not_reached_the_newest_are_not_tried_again(swarm):
    explorer = Explorer(swarm[0], CommonFrame("map"))
    pose = swarm[0].true_pose
    places = [(5.0 + number, 0.0) for number in range(6)]
    for tried in range(1, 7):
        explorer.choose(pose, places[:tried], [], 0.0)
        assert explorer.goal == places[tried - 1], "all nearer ones have failed"
        explorer.controller.state = State.FAILED
    explorer.choose(pose, places, [], 0.0)
    assert explorer.goal == places[0]  # failed longest ago


def test_a_robot_without_ranges_stops_and_goes_on_when_they_come(swarm, monkeypatch):
    robot, driven = swarm[0], []
    monkeypatch.setattr(robot, "drive", lambda *command: driven.append(command))
    explorer, ranges = Explorer(robot, CommonFrame("map")), robot.fresh_proximity()
    for known in ([math.nan] * 8, [*ranges[:1], *[math.nan] * 7]):
        monkeypatch.setattr(robot, "fresh_proximity", lambda known=known: known)
        explorer.step([LEFT], [], 0.0)
        assert (explorer.common.missing["hero_0"] == NOT_CALIBRATED) == all(map(math.isnan, known))
    assert driven[0] == (0.0, 0.0) and driven[1] != (0.0, 0.0)


@pytest.mark.parametrize("has_goal", [False, True])
def test_before_an_obstacle_a_bump_shield_is_slower(monkeypatch, has_goal):
    speeds_m_s = []
    with StepSwarm(2, model="hero_plus,robot=1") as swarm:
        for robot in swarm:
            monkeypatch.setattr(robot, "fresh_proximity", lambda: [0.12, *[math.inf] * 7])
            monkeypatch.setattr(robot, "drive", lambda *command: speeds_m_s.append(command[0]))
            ahead = transform_pose(robot.true_pose, Pose(1.0, 0.0, 0.0))
            Explorer(robot, CommonFrame("map"), seed=0).step([ahead[:2]] if has_goal else [], [], swarm.now_s)
    stock_m_s, plus_m_s = speeds_m_s
    assert 0.0 <= plus_m_s < stock_m_s


@pytest.mark.slow
def test_robots_that_explore_late_drive_slowly_and_say_so_once(swarm, monkeypatch):
    said = []
    monkeypatch.setattr(explore_program.rospy, "logwarn", said.append)
    explorers = [Explorer(robot, CommonFrame("map"), seed=robot.robot_id) for robot in swarm]

    def run(places, hz, duration_s):
        path = true_paths.run(swarm, lambda _: explore_together(explorers, places, swarm.now_s), duration_s, hz)[0]
        return true_paths.measure_lengths(path) / duration_s

    run([], 10.0, 1.0)  # they speed up
    usual_m_s = run([], 10.0, 1.5)
    assert not said
    run([], 2.5, 1.0)
    late_m_s = run([], 2.5, 1.5)
    assert (0.3 * usual_m_s < late_m_s).all() and (late_m_s < 0.7 * usual_m_s).all()
    (text,) = said
    assert text.startswith("commands are late by 0.3 s: this PC is busy; robots drive at 4"), "poses have an age, too"
    run([LEFT, RIGHT], 10.0, 4.0)
    said.clear()
    run([LEFT, RIGHT], 2.5, 1.0)
    (text,) = said
    assert text.startswith("commands are late by 0.3 s"), "on the way to places"


HERE = Pose(0.0, 0.0, 0.0)


def test_a_goal_is_kept_until_the_map_goes_on_or_the_robot_is_near():
    explorer = Explorer(None, None)
    explorer.choose(HERE, [(1.0, 0.0), (0.0, 0.9)], [], 0.0)
    assert explorer.goal == (0.0, 0.9), "the nearest"
    kept = explorer.controller
    assert kept._avoid, "the map has unknown places"
    for pose, frontiers in ((HERE, [(0.14, 0.9), (0.5, 0.0)]), (Pose(0.0, 0.9 - 1.01 * NEAR_M, 0.0), [(0.0, 0.9)])):
        explorer.choose(pose, frontiers, [], 1.0)
        assert explorer.controller is kept
    explorer.choose(HERE, [(0.16, 0.9), (0.5, 0.0)], [], 1.0)
    assert explorer.goal == (0.5, 0.0), "the map goes on there now"
    explorer.choose(Pose(0.5 - 0.99 * NEAR_M, 0.0, 0.0), [(0.5, 0.0), (2.0, 0.0)], [], 1.0)
    assert explorer.goal is None, "near it, the robot walks at random"
    explorer.choose(HERE, [(0.99 * NEAR_M, 0.0), (2.0, 0.0)], [], 1.0)
    assert explorer.goal is None
    explorer.choose(HERE, [(1.01 * NEAR_M, 0.0)], [], 1.0)
    assert explorer.goal is not None
    explorer.choose(HERE, [], [], 1.0)
    assert explorer.goal is None, "nothing is left"


def test_goals_of_robots_are_apart_and_end_after_half_a_minute():
    explorer, free = Explorer(None, None), (3.0, 0.0)
    for other, expected in (((1.0, 0.29), free), ((1.0, 0.31), (1.0, 0.0)), ((1.2, 0.2), free)):
        explorer.controller = None
        explorer.choose(HERE, [(1.0, 0.0), free], [(9.0, 9.0), other], 5.0)
        assert explorer.goal == expected, other
    walled = [math.inf] * 8
    for now_s, state in ((34.9, State.ACTIVE), (35.1, State.FAILED)):
        explorer.controller.step(HERE, walled, now_s)
        assert explorer.controller.state is state
