"""Goals in virtual time: reached within their tolerance, with and without obstacles."""

import math
import random
from unittest import mock

import numpy as np
import pytest
import true_paths
from program_runs import Run

from hero_client.controllers import Goal
from hero_client.values.errors import GoalError
from hero_sim.stepped import StepSwarm
from hero_sim.world import load_arena
from hero_test.nonempty import nonempty

WORLDS = 30
TOLERANCE_M = 0.01
TRUE_TOLERANCE_M = 0.015
"""With what odometry may be off."""

ROUND_THE_POST = """
walls_m: [[[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]]
circles_m: [[0, 0, 0.06]]
starts_m_deg: [[-0.4, 0.02, 0]]
"""


def start_each(swarm, choose_goal, **options):
    """Start a motion of each robot to a goal in world; return the motions and the goals."""
    goals = [choose_goal(world) for world in range(len(swarm.robots))]
    return [robot.start_go_to(*goal, frame="world", **options) for robot, goal in zip(swarm, goals)], goals


@pytest.mark.slow
def test_random_goals_are_reached_and_no_robot_swings_there():
    rng = random.Random(5)
    with StepSwarm(1, seed=1, arena="empty", perfect=True, worlds=WORLDS) as swarm:
        log = swarm.log()
        motions, goals = start_each(
            swarm, lambda world: (rng.uniform(-0.6, 0.6), rng.uniform(-0.6, 0.6), rng.uniform(-math.pi, math.pi))
        )
        for motion in motions:
            motion.result()
        for path, goal in nonempty(zip(true_paths.split_worlds(log), goals)):
            distances_m = np.hypot(*(path[:, 0, :2] - goal[:2]).T)
            assert distances_m[-1] < TRUE_TOLERANCE_M
            assert abs(math.remainder(path[-1, 0, 2] - goal[2], math.tau)) < 0.12
            arrived = np.argmax(distances_m < TOLERANCE_M)
            assert distances_m[arrived:].max() < 2.0 * TRUE_TOLERANCE_M
        assert true_paths.stop_within(swarm)


@pytest.mark.slow
@pytest.mark.parametrize("avoid", [True, False])
def test_a_post_in_the_way_is_avoided_or_named_and_never_touched(tmp_path, avoid):
    arena = tmp_path / "post.yaml"
    arena.write_text(ROUND_THE_POST)
    rng = random.Random(7)
    with StepSwarm(1, seed=1, arena=str(arena), worlds=WORLDS) as swarm:
        log = swarm.log()
        motions, goals = start_each(swarm, lambda world: (0.4, rng.uniform(-0.05, 0.05)), avoid=avoid)
        errors = [motion.exception() for motion in motions]
        for path, goal, error in nonempty(zip(true_paths.split_worlds(log), goals, errors)):
            assert true_paths.measure_wall_gaps(path, load_arena(str(arena))).min() > 0.005
            if avoid:
                assert error is None and math.dist(path[-1, 0, :2], goal) < 0.1  # odometry has drifted
            else:
                assert "an obstacle is in the way" in str(error)
        assert true_paths.stop_within(swarm)


def test_a_goal_around_obstacles_fails_for_sensors_without_calibration():
    with StepSwarm(1, seed=1, arena="empty") as swarm:
        swarm.rows.set_infrared_calibration(0, np.full(8, math.nan))
        swarm.sleep(0.3)
        log, start_s = swarm.log(), swarm.now_s
        with pytest.raises(GoalError, match="cannot go around obstacles: its infrared sensors are not calibrated"):
            swarm[0].go_to(0.3, 0.0, avoid=True)
        assert swarm.now_s - start_s < 3.0
        assert np.ptp(log.true_pose[:, 0, 0], axis=0).max() < 1e-6


@pytest.mark.parametrize("reached", [True, False])
def test_the_program_serves_each_robot_with_its_goal_and_the_limits(monkeypatch, reached):
    pytest.importorskip("actionlib", reason="the server of goals is a node's")
    from hero_examples.driving import go_to_goal

    real, servers, ends = go_to_goal.GoToGoalServer, {}, []

    def serve(robot, *limits):
        server = mock.create_autospec(real, instance=True)
        server.robot, server.limits, server.busy, server.reached = robot, limits, False, reached or robot.robot_id == 4
        server.give_up.side_effect = lambda: ends.append("give up")
        server.close.side_effect = lambda: ends.append("close")
        return servers.setdefault(robot.robot_id, server)

    monkeypatch.setattr(go_to_goal, "GoToGoalServer", mock.create_autospec(real, side_effect=serve))
    with StepSwarm(2, first_id=4) as swarm:
        given = {"robots": "4 5", "goals": "0.1 0.2; 0.3 0.4 90", "frame": "map", "once": True}
        run = Run(monkeypatch, go_to_goal, swarm, 5.0, tolerance_m=0.02, timeout_s=9.0, avoid=True, **given)
        assert run() == (0 if reached else 1) and run.asked == [([4, 5], True, True)]
    assert {robot_id: server.limits for robot_id, server in servers.items()} == dict.fromkeys((4, 5), (0.02, 9.0, True))
    assert servers[4].put_goal.mock_calls == [mock.call(Goal(0.1, 0.2), "map")]
    assert servers[5].put_goal.mock_calls == [mock.call(Goal(0.3, 0.4, math.pi / 2.0), "map")]
    assert ends == ["give up", "give up", "close", "close"], "all stop at the same time"
