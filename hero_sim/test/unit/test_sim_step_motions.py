"""Motions of robots, in virtual time: done, or an error that says why not, judged by the ground truth."""

import gc
import math
from pathlib import Path

import numpy as np
import pytest

from hero_client import FrameError, GoalError, StoppedError
from hero_node.robot_constants import BODY_RADIUS_M
from hero_sim.stepped.swarm import StepSwarm
from hero_test.nonempty import nonempty

CORNER_ARENA = str(Path(__file__).resolve().parents[3] / "test" / "hero_test" / "arenas" / "examples_arena.yaml")
CORNERED = 4
"""hero_4 stands in the corner: a wall 0.12 m ahead of its center, another 0.16 m to its left."""

SEEDS = range(4)
MANY = 40

POST = """
bounds_m: [-1, -1, 1, 1]
walls_m: [[[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]]
circles_m: [[0.0, 0.01, 0.05]]
starts_m_deg: [[-0.4, 0.0, 0]]
"""


def find_motion(before, after):
    """Return by how much (m, m, rad) a pose has changed, in the frame of the first one."""
    x_m, y_m, turn_rad = (new - old for new, old in zip(after, before))
    cos, sin = math.cos(before.yaw_rad), math.sin(before.yaw_rad)
    return cos * x_m + sin * y_m, cos * y_m - sin * x_m, math.remainder(turn_rad, math.tau)


def travel_m(robot, before):
    return math.dist(before[:2], robot.true_pose[:2])


def is_at_rest(swarm):
    """Return whether no robot moves for a second, after the half that wheels take to come to rest."""
    swarm.sleep(0.5)
    before = [robot.true_pose for robot in swarm]
    swarm.sleep(1.0)
    return all(math.dist(robot.true_pose, pose) < 1e-4 for robot, pose in zip(swarm, before))


def note_commands(swarm, monkeypatch):
    """Return the list that grows by (ms, row, m/s, rad/s) with each velocity command."""
    sent, send = [], swarm.rows.send_velocity

    def note(row, *velocity):
        sent.append((swarm.rows.now_ms, row, *velocity))
        send(row, *velocity)

    monkeypatch.setattr(swarm.rows, "send_velocity", note)
    return sent


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_forward_and_turn_move_by_what_they_are_told(seed):
    robot = StepSwarm(1, seed=seed).robots[0]
    for distance_m, angle_rad in ((-0.1, 1.0), (0.2, -2.0), (0.05, 7.0)):
        before = robot.true_pose
        robot.forward(distance_m)
        ahead_m, aside_m, _ = find_motion(before, robot.true_pose)
        assert ahead_m == pytest.approx(distance_m, abs=0.012)
        assert aside_m == pytest.approx(0.0, abs=0.012)
        before = robot.true_pose
        robot.turn(angle_rad)
        assert robot.true_pose.yaw_rad - before.yaw_rad == pytest.approx(angle_rad, abs=0.03 + 0.04 * abs(angle_rad))
        assert travel_m(robot, before) < 0.01


@pytest.mark.slow
def test_many_robots_reach_a_place_and_a_heading():
    swarm = StepSwarm(1, worlds=MANY)
    before = [robot.true_pose for robot in swarm]
    swarm.go_to(-0.15, 0.1, yaw_rad=1.5, frame="robot", timeout_s=40.0)
    for robot, start in nonempty(zip(swarm, before)):
        ahead_m, aside_m, turn_rad = find_motion(start, robot.true_pose)
        assert math.dist((ahead_m, aside_m), (-0.15, 0.1)) < 0.03
        assert turn_rad == pytest.approx(1.5, abs=0.2)
    assert is_at_rest(swarm)


@pytest.mark.slow
def test_goals_may_be_in_odometry_relative_or_in_the_world():
    swarm = StepSwarm(1, worlds=MANY, perfect=True)
    before = [robot.true_pose for robot in swarm]
    swarm.go_to(-0.1, 0.0, frame="robot")
    assert all(travel_m(robot, pose) == pytest.approx(0.1, abs=0.015) for robot, pose in zip(swarm, before))
    for robot in swarm:
        robot.set_pose(1.0, 2.0, 3.0)  # frame "world" must not care
    motions = [robot.start_go_to(*pose[:2], frame="world") for robot, pose in zip(swarm, before)]
    assert [motion.exception() for motion in motions] == [None] * MANY
    assert all(travel_m(robot, pose) < 0.02 for robot, pose in zip(swarm, before))
    for robot in swarm:
        assert math.dist(robot.pose_in("/world")[:2], robot.true_pose[:2]) < 0.01
    there = [robot.true_pose for robot in swarm]
    swarm.go_to(0.08, 0.06, yaw_rad=1.0, frame="robot")
    for robot, pose in nonempty(zip(swarm, there)):
        ahead_m, aside_m, turn_rad = find_motion(pose, robot.true_pose)
        assert (ahead_m, aside_m) == pytest.approx((0.08, 0.06), abs=0.03)
        assert turn_rad == pytest.approx(1.0, abs=0.06)
    swarm.robots[0].go_to(1.0, 2.0)  # of its odometry: where it was before the last goal
    assert travel_m(swarm.robots[0], before[0]) == pytest.approx(0.1, abs=0.02)
    with pytest.raises(FrameError, match="no transform from hero_0/odom to nowhere"):
        swarm.robots[0].pose_in("nowhere")
    with pytest.raises(FrameError, match="nowhere"):
        swarm.robots[0].go_to(0.0, 0.0, frame="nowhere")
    assert is_at_rest(swarm)


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_a_goal_behind_a_wall_is_an_error_that_tells_of_the_wall(seed):
    robot = StepSwarm(6, seed=seed, arena=CORNER_ARENA)[CORNERED]
    with pytest.raises(GoalError, match=r"hero_4 did not reach \(0.3, 0\) .*obstacle is in the way, 0.\d\d m.* left"):
        robot.go_to(0.3, 0.0, frame="robot")
    assert robot.true_pose.x_m < 2.0 - BODY_RADIUS_M - 0.003  # it did not touch the wall
    robot.forward(-0.05)
    with pytest.raises(GoalError, match="hero_4 did not drive 0.3 m: an obstacle is in the way"):
        robot.forward(0.3)


@pytest.mark.slow
def test_a_robot_told_to_avoid_drives_around_what_stops_it_else(tmp_path):
    path = tmp_path / "post.yaml"
    path.write_text(POST)
    with pytest.raises(GoalError, match="obstacle is in the way"):
        StepSwarm(1, arena=str(path))[0].go_to(0.4, 0.0, frame="world")
    swarm = StepSwarm(1, arena=str(path), worlds=MANY // 4)
    log = swarm.log()
    swarm.go_to(0.4, 0.0, frame="world", avoid=True, timeout_s=60.0)
    for robot in nonempty(swarm):
        # Wheels differ, and odometry drifts on the way.
        assert math.dist(robot.true_pose[:2], (0.4, 0.0)) < 0.06
    distances_m = np.hypot(*np.moveaxis(log.true_pose[..., :2] - (0.0, 0.01), -1, 0))
    assert distances_m.min() - 0.05 - BODY_RADIUS_M > 0.003


@pytest.mark.slow
def test_a_robot_whose_wheels_do_not_turn_fails_and_says_so():
    swarm = StepSwarm(2, error=["left_gain=0,right_gain=0,robot=1"])
    swarm[0].turn(1.0)
    for move in (lambda: swarm[1].turn(1.0), lambda: swarm[1].forward(0.1), lambda: swarm[1].go_to(0.1, 0.0)):
        begun_s = swarm.now_s
        with pytest.raises(GoalError, match="hero_1 did not .*: its wheels do not turn: is something blocking them"):
            move()
        assert swarm.now_s - begun_s < 6.0


@pytest.mark.slow
@pytest.mark.parametrize("wifi", ["ideal", "router"])
def test_one_stop_brings_robots_to_rest_at_each_phase_of_their_loop(wifi, monkeypatch):
    swarm = StepSwarm(4, wifi=wifi)
    sent = note_commands(swarm, monkeypatch)
    for phase_ms in range(0, 60, 10):
        swarm.drive(0.1, 0.5)
        swarm.sleep(0.5)
        # A motion as late as a program can send one, so that the stop meets it in front of the robot.
        swarm.drive(0.1, -0.5)
        swarm.sleep(phase_ms / 1000.0)
        del sent[:]
        swarm.stop()
        assert len(sent) == len(swarm)
        swarm.sleep(0.5)
        # Well before the firmware's watchdog of about 2 s would stop them.
        assert is_at_rest(swarm)


def test_motions_wait_for_simulated_time_only_as_long_as_they_are_told():
    swarm = StepSwarm(1)
    motion = swarm[0].start_go_to(0.2, 0.0, frame="robot")
    assert not motion.done()
    with pytest.raises(Exception) as caught:
        motion.result(timeout=0.5)
    assert type(caught.value).__name__ == "TimeoutError"
    assert swarm.now_s == 0.5
    assert motion.result() is None
    assert motion.done() and motion.exception() is None


@pytest.mark.slow
def test_a_swarm_moves_as_one_and_tells_who_did_not():
    swarm = StepSwarm(6, arena=CORNER_ARENA)
    before = [robot.true_pose for robot in swarm]
    with pytest.raises(GoalError, match=r"\Ahero_4 did not reach[^;]*in the way[^;]*\Z"):
        swarm.go_to(0.15, 0.0, frame="robot")
    for robot, pose in nonempty(zip(swarm, before)):
        assert travel_m(robot, pose) == pytest.approx(0.15, abs=0.02) or robot.robot_id == CORNERED
    with pytest.raises(GoalError, match=r"\Ahero_0 did not .*; hero_5 did not [^;]*\Z"):
        swarm.go_to(50.0, 0.0, timeout_s=0.5)
    before = [robot.true_pose for robot in swarm]
    swarm.drive(0.0, 1.0, duration_s=1.0)
    turned_rad = [robot.true_pose.yaw_rad - pose.yaw_rad for robot, pose in zip(swarm, before)]
    assert min(turned_rad) > 0.3, turned_rad
    assert is_at_rest(swarm)


@pytest.mark.slow
def test_while_all_robots_are_stopped_motions_are_errors_that_tell_so(capsys):
    swarm = StepSwarm(2)
    robot = swarm[0]
    assert not robot.is_stopped
    motion = robot.start_go_to(5.0, 0.0, frame="robot")
    swarm.sleep(1.0)
    swarm.emergency_stop()
    assert robot.is_stopped and repr(robot).startswith("<hero_0: stopped, ")
    reason = r"hero_0 does not move: all robots are stopped\. Release them with StepSwarm\.release_stop\(\)"
    with pytest.raises(StoppedError, match=reason):
        motion.result()
    assert is_at_rest(swarm)
    for move in (
        lambda: robot.drive(0.1, 0.0, 1.0),
        lambda: robot.turn(1.0),
        lambda: robot.forward(0.1),
        lambda: robot.go_to(0.0, 0.0),
    ):
        with pytest.raises(StoppedError, match=reason):
            move()
    for _ in swarm.rate(10):
        robot.drive(0.1, 0.0)  # one command in a loop is no error, but it is told
        if swarm.now_s > 7.0:
            break
    assert capsys.readouterr().err.count("hero_0 does not move") == 1
    assert is_at_rest(swarm)
    swarm.release_stop()
    robot.forward(0.05)


def test_goals_and_poses_that_mean_nothing_are_refused_at_once():
    swarm = StepSwarm(2)
    for wrong in (math.nan, math.inf, "1", [1.0]):
        with pytest.raises(ValueError, match="of a goal must be finite"):
            swarm[0].go_to(0.1, wrong)
        with pytest.raises(ValueError, match="of a goal must be finite"):
            swarm[0].start_go_to(0.1, 0.1, yaw_rad=wrong)
        with pytest.raises(ValueError, match="of a pose must be finite"):
            swarm[0].set_pose(0.0, 0.0, wrong)
    for wrong in (math.nan, "1"):
        with pytest.raises(ValueError, match="goal of hero_1 must be finite"):
            swarm.go_to({0: (0.0, 0.3), 1: (wrong, 0.0)})
    swarm[0].go_to(np.float32(0.05), np.int64(0))
    assert swarm.now_s < 5.0


@pytest.mark.slow
def test_dropping_a_swarm_with_a_motion_on_its_way_is_no_error(recwarn):
    gc.collect()  # what other tests left
    recwarn.clear()
    swarm = StepSwarm(1)
    swarm[0].start_go_to(1.0, 0.0)
    swarm[0].blink("red")
    swarm.sleep(0.5)
    del swarm
    gc.collect()
    assert not recwarn.list
