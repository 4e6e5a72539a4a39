"""swarm_go_to in virtual time: robots whose odometry drifts swap places and form up without touching."""

from pathlib import Path

import numpy as np
import pytest
import true_paths
from program_runs import Run

from hero_client import CommonFrame, HeroError, ProgramError
from hero_client.apps.formations import assign_goals, place_formation
from hero_client.controllers import AvoidanceLaw
from hero_client.values.errors import GoalError
from hero_client.values.readings import NOT_CALIBRATED
from hero_sim.stepped import StepSwarm
from hero_sim.world import load_arena

pytest.importorskip("rospy", reason="the program imports rospy")
from hero_examples.swarm import swarm_go_to
from hero_examples.swarm.swarm_go_to import STEP_HZ, Formation

CIRCLE = str(Path(__file__).resolve().parents[3] / "test" / "hero_test" / "arenas" / "circle_arena.yaml")
LAW = AvoidanceLaw()


def form(swarm, goals, **options):
    """Drive to the goals; return the formation and the path."""
    formation = Formation(swarm, CommonFrame("world"), goals, LAW, **options)

    def step(time_s):
        formation.step(time_s)
        return formation.done

    return formation, true_paths.run(swarm, step, 130.0, hz=STEP_HZ)[0]


@pytest.mark.slow
def test_ten_robots_swap_places_across_a_circle_without_touching():
    with StepSwarm(10, seed=100, arena=CIRCLE) as swarm:
        goals = [(-robot.true_pose.x_m, -robot.true_pose.y_m) for robot in swarm]
        formation, path = form(swarm, goals)
        drift_m = np.hypot(*(swarm.rows.world.poses[:, :2] - goals).T).max()
        assert {robot.light for robot in swarm} == {(0.0, 1.0, 0.0)}
    assert formation.done
    assert drift_m > 0.03  # or this would try nothing
    assert true_paths.measure_gaps(path).min() > 0.002
    assert true_paths.stop_within(swarm)


@pytest.mark.slow
@pytest.mark.parametrize("count, hz", [(8, 6.8), (8, 3.0), (8, 1.6)])
def test_robots_whose_program_is_late_are_slow_and_do_not_touch(count, hz):
    warnings = []
    with StepSwarm(count, seed=100, arena=CIRCLE) as swarm:
        swarm._log = lambda level, text: warnings.append(text)
        goals = [(-robot.true_pose.x_m, -robot.true_pose.y_m) for robot in swarm]
        formation = Formation(swarm, CommonFrame("world"), goals, LAW)
        path = true_paths.run(swarm, formation.step, 60.0, hz=hz)[0]
    assert true_paths.measure_gaps(path).min() > 0.005
    assert true_paths.measure_lengths(path).min() > 0.3
    assert hz > 5.0 or "commands are late by" in warnings[0]


@pytest.mark.slow
def test_a_robot_that_drives_by_its_pose_alone_is_named():
    with StepSwarm(2, arena="empty") as swarm:
        log, calibrated = [], swarm[1].fresh_proximity
        swarm[0]._link.log_warning = log.append
        swarm[0].fresh_proximity = lambda: [np.nan] * 8
        formation = Formation(swarm, CommonFrame("world"), [(0.5, 0.5), (-0.5, -0.5)], LAW)
        path = true_paths.run(swarm, formation.step, 4.0)[0]
        assert true_paths.measure_lengths(path).min() > 0.03
        assert log == ["hero_0 drives by its pose alone: " + NOT_CALIBRATED] and calibrated()


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["circle", "grid", "line"])
def test_robots_take_their_places_in_a_formation(shape):
    wanted = {"shape": shape, "spacing_m": 0.25}
    with StepSwarm(8, seed=4, arena="empty", perfect=True) as swarm:
        places = [robot.true_pose[:2] for robot in swarm]
        goals = place_formation(wanted, len(swarm), LAW.min_spacing_m)
        goals = [goals[index] for index in assign_goals(places, goals)]
        formation, path = form(swarm, goals)
        assert formation.done
        off_m = np.hypot(*(swarm.rows.world.poses[:, :2] - goals).T)
    assert off_m.max() < 0.03
    assert true_paths.measure_gaps(path).min() > 0.005
    assert true_paths.measure_wall_gaps(path, load_arena("empty")).min() > 0.005


def test_robots_that_are_not_in_place_in_time_are_named():
    swarm = StepSwarm(2, arena="empty")
    with pytest.raises(ProgramError, match="after 2 s not in place: hero_0, hero_1"):
        form(swarm, [(0.0, 50.0), (50.0, 0.0)], timeout_s=2.0)


def test_places_of_robots_with_a_bump_shield_are_farther_apart(monkeypatch):
    swarm = StepSwarm(2, arena="empty", model="hero_plus,robot=1")
    with pytest.raises(HeroError, match=r"two places are 0\.200 m apart, but robots need 0\.22 m"):
        Run(monkeypatch, swarm_go_to, swarm, 1.0, formation={"shape": "line", "spacing_m": 0.2})()


def test_robots_take_the_nearest_places_unless_told_otherwise(monkeypatch):
    with StepSwarm(2, arena="empty") as swarm:
        places, log = [list(robot.true_pose[:2]) for robot in (swarm[1], swarm[0])], swarm.log()
        given = {"formation": {"shape": "points", "points": places}, "once": True, "timeout_s": 2.0}
        assert Run(monkeypatch, swarm_go_to, swarm, **given)() == 0
        assert true_paths.measure_lengths(true_paths.split_worlds(log)[0]).max() < 0.01
        with pytest.raises(HeroError, match="after 2 s not in place: hero_0, hero_1"):
            Run(monkeypatch, swarm_go_to, swarm, assign=False, **given)()


def freeze_first(swarm):
    """Let localize give the first robot's pose of now for ever, and true poses of the others."""
    frozen = swarm[0].true_pose
    swarm[0].localize_by(lambda: frozen)
    swarm[1].localize_by(lambda: swarm[1].true_pose)


@pytest.mark.slow
def test_a_robot_whose_pose_is_frozen_ends_go_to_each_with_the_reason():
    with StepSwarm(2, seed=1, arena="empty") as swarm:
        freeze_first(swarm)
        log, start_s = swarm.log(), swarm.now_s
        with pytest.raises(GoalError, match="hero_0: its wheels turn, but its pose stays the same"):
            swarm.go_to_each({0: (0.6, 0.5), 1: (-0.6, 0.5)})
        assert swarm.now_s - start_s < 6.0
        assert true_paths.measure_lengths(true_paths.split_worlds(log)[0])[0] < 0.45
        assert true_paths.stop_within(swarm)


@pytest.mark.slow
def test_all_robots_stop_and_one_whose_pose_is_frozen_is_named():
    with StepSwarm(2, seed=1, arena="empty") as swarm:
        freeze_first(swarm)
        formation = Formation(swarm, CommonFrame("map"), [(0.6, 0.5), (-0.6, 0.5)], LAW)
        true_paths.run(swarm, formation.step, 8.0)
        assert "pose stays the same" in formation.common.missing["hero_0"]
        assert true_paths.stop_within(swarm, 0.0)


def test_all_robots_stop_while_the_pose_of_one_is_not_known():
    with StepSwarm(2, arena="empty") as swarm:
        common = CommonFrame("world")
        formation = Formation(swarm, common, [(0.5, 0.5), (-0.5, -0.5)], LAW)
        path = true_paths.run(swarm, formation.step, 2.0)[0]
        assert true_paths.measure_lengths(path).min() > 0.03
        common.frame = "nowhere"
        true_paths.run(swarm, formation.step, 1.0)
        assert true_paths.stop_within(swarm, 0.0)
        assert not formation.done
