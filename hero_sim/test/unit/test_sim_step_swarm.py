"""Robots stepped in process have the interface of Robot and Swarm, and the same calls give the same bytes."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest
from driver_side import parse_options

from hero_client import CommonFrame, GoalError, StaleDataError
from hero_client.controllers import WanderMemory, wander
from hero_sim import main
from hero_sim.errors import OptionError
from hero_sim.population import build_world
from hero_sim.stepped.robot_rows import RobotRows
from hero_sim.stepped.step_clock import StepClock, StepMotion
from hero_sim.stepped.swarm import StepSwarm
from hero_sim.world import arena
from hero_test.nonempty import nonempty
from hero_test.robot_program import go_around

CORNER_ARENA = str(Path(__file__).resolve().parents[3] / "test" / "hero_test" / "arenas" / "examples_arena.yaml")
CORNERED = 4
"""hero_4 stands in the corner: a wall 0.12 m ahead of its center, another 0.16 m to its left."""


def wander_about(swarm, seed, duration_s=8.0):
    """Let robots walk at random, and one go to goals in the background; return the bytes of all their poses."""
    log = swarm.log()
    dice = np.random.RandomState(seed)
    memories = {robot: WanderMemory() for robot in swarm}
    motion = swarm[0].start_go_to(0.1, 0.1, frame="robot")
    swarm[0].blink("red", 0.4)
    for time_s in swarm.rate(10):
        if time_s > duration_s:
            break
        for robot in list(swarm)[1:]:
            command, memories[robot] = wander(robot.proximity, memories[robot], dice.random_sample())
            robot.drive(*command)
        if motion.done():
            motion = swarm[0].start_go_to(*swarm[0].pose[:2], yaw_rad=float(dice.random_sample()))
    return log.pose.tobytes() + log.true_pose.tobytes()


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes_and_another_seed_others():
    first, again, other = (wander_about(StepSwarm(6, seed=seed), 1) for seed in (5, 5, 6))
    assert len(first) > 160 * 6 * 6 * 8
    assert first == again
    assert first != other


@pytest.mark.slow
def test_each_world_of_a_batch_is_that_of_its_seed_alone():
    batch = StepSwarm(3, seed=7, worlds=3)
    log = batch.log(ranges=True)
    for world in batch.worlds:
        [robot.start_go_to(0.15, 0.1, frame="robot") for robot in world]
    batch.sleep(6.0)
    for index in range(3):
        alone = StepSwarm(3, seed=7 + index)
        alone_log = alone.log(ranges=True)
        [robot.start_go_to(0.15, 0.1, frame="robot") for robot in alone]
        alone.sleep(6.0)
        for name in ("pose", "true_pose", "velocity", "command", "range_m"):
            np.testing.assert_array_equal(getattr(log, name)[:, [index]], getattr(alone_log, name))


@pytest.mark.parametrize("seed", range(6))
def test_a_program_for_a_robot_runs_unchanged_in_process(seed):
    swarm = StepSwarm(1, seed=seed)
    start = swarm[0].true_pose
    with swarm:
        pose = go_around(swarm[0])
        assert math.dist(pose[:2], (0.06, 0.0)) < 0.02
        assert swarm[0].light == (1.0, 0.0, 0.0) or swarm[0].light == (0.0, 0.0, 0.0)
    assert math.dist(swarm[0].true_pose[:2], start[:2]) == pytest.approx(0.06, abs=0.015)
    assert swarm[0].light == (0.0, 0.0, 0.0)  # leaving ended the blinking
    swarm.sleep(2.0)
    assert swarm[0].light == (0.0, 0.0, 0.0)


@pytest.mark.slow
def test_over_wifi_data_are_older_and_motions_still_reach_their_goals():
    swarm = StepSwarm(1, wifi="hotspot", worlds=10)
    log = swarm.log()
    ages_s = []
    motions = [robot.start_go_to(0.15, 0.1, yaw_rad=1.0, frame="robot") for robot in swarm]
    while not all(motion.done() for motion in motions):
        swarm.sleep(0.01)
        ages_s += [robot.age_s("odom") for robot in swarm]
    assert max(ages_s) > 0.1
    assert [motion.exception() for motion in motions] == [None] * 10
    for row in range(10):
        alone = StepSwarm(1, seed=row, wifi="hotspot")
        alone_log = alone.log()
        [robot.start_go_to(0.15, 0.1, yaw_rad=1.0, frame="robot") for robot in alone]
        alone.sleep(2.0)
        assert alone_log.pose.tolist() == log.pose[: len(alone_log), [row]].tolist()


def test_robots_are_taken_by_their_ids_and_describe_themselves():
    swarm = StepSwarm(3, first_id=100)
    assert [robot.robot_id for robot in swarm] == [100, 101, 102] and len(swarm) == 3
    assert (swarm[101].name, swarm[101].namespace) == ("hero_101", "/hero_101")
    with pytest.raises(KeyError, match="hero_1 is not in this swarm: hero_100, hero_101, hero_102"):
        swarm[1]
    assert repr(swarm) == "<Swarm of hero_100, hero_101, hero_102: 3 of 3 ready>"
    assert repr(swarm[100]) == "<hero_100: ready, Pose(x_m=0.000, y_m=0.000, yaw_rad=0.000)>"
    assert swarm.wait_until_ready() is swarm


def test_robots_of_a_batch_are_those_of_all_worlds():
    batch = StepSwarm(2, worlds=3)
    assert [robot.robot_id for robot in batch] == [0, 1] * 3
    assert batch[1] is batch.worlds[0][1] and batch.worlds[2][1] is batch.robots[5]
    assert [robot.row for robot in batch] == list(range(6))


def test_robots_and_places_are_those_of_the_command_line():
    swarm = StepSwarm(3, seed=4, error=["robot=1,left_center_us=1540"])
    world = build_world(parse_options("--count", "3", "--seed", "4", "--error", "robot=1,left_center_us=1540"))
    assert (swarm.rows.world.poses == world.poses).all()
    assert (swarm.rows.world.errors.servo_center_us == world.errors.servo_center_us).all()
    assert swarm.rows.world.errors.servo_center_us[1, 0] == 1540.0


def test_places_drawn_have_room_for_the_widest_robot():
    options = "--count 20 --arena obstacles --model hero_plus,robot=3"
    world = build_world(parse_options(*options.split()))
    assert world.errors.radius_m.argmax() == 3 and world.errors.radius_m.max() == 0.06
    gaps_m = arena.measure_clearance(world.poses[:, :2], world.arena)
    assert gaps_m[len(world.arena.starts) :].min() >= 0.06 + arena.START_GAP_M


@pytest.mark.slow
@pytest.mark.parametrize("wifi", ["ideal", "hotspot"])
def test_hero_plus_beside_a_stock_robot_drives_and_measures_ahead(wifi):
    options = {"perfect": True, "error": ["slip=0"], "model": "hero_plus,robot=1"}
    swarm = StepSwarm(2, arena="empty", wifi=wifi, worlds=2, **options)
    assert swarm.rows.distance_rows.tolist() == [1, 3]
    starts, seen_m = [robot.true_pose for robot in swarm], [world[1].distance for world in swarm.worlds]
    for robot in swarm:
        robot.forward(0.15)
    swarm.sleep(0.5)
    for robot, start in nonempty(zip(swarm, starts)):
        x_m, y_m = robot.true_pose[0] - start[0], robot.true_pose[1] - start[1]
        assert math.hypot(x_m, y_m) == pytest.approx(robot.pose.x_m, rel=0.01)
        assert robot.pose.x_m == pytest.approx(0.15, abs=0.01)
    assert [world[1].distance + 0.15 for world in swarm.worlds] == pytest.approx(seen_m, abs=0.03)
    with pytest.raises(StaleDataError, match="no message on /hero_0/distance"):
        swarm[0].distance  # noqa: B018


def test_wheel_speeds_of_hero_plus_are_those_of_its_rims():
    swarm = StepSwarm(2, perfect=True, error=["slip=0"], model="hero_plus,robot=1")
    swarm.drive(0.0, 2.0, duration_s=1.0)
    measured_m_s, start_m, start_s = [], swarm.rows.world.travels_m.copy(), swarm.now_s
    for _ in range(300):
        swarm.drive(0.0, 2.0)
        swarm.sleep(0.034)
        measured_m_s.append([robot.wheel_speeds for robot in swarm])
    rolled_m = (swarm.rows.world.travels_m - start_m) * swarm.rows.world.errors.wheel_scale
    true_m_s = rolled_m / (swarm.now_s - start_s)
    assert np.mean(measured_m_s, axis=0) == pytest.approx(true_m_s, rel=0.01)


def test_proximity_begins_ahead_and_goes_round_to_the_left():
    swarm = StepSwarm(6, arena=CORNER_ARENA)
    robot = swarm[CORNERED]
    for ranges in (robot.proximity, robot.wait_for_scan(), robot.fresh_proximity()):
        assert len(ranges) == 8
        assert ranges[0] == pytest.approx(0.12, abs=0.02) and ranges[2] == pytest.approx(0.16, abs=0.03)
        assert ranges[4:7] == [math.inf] * 3  # behind, and to the right: free
    assert robot.nearest().range_m == pytest.approx(0.12, abs=0.02)
    assert robot.nearest().bearing_rad == pytest.approx(0.0)
    assert swarm[5].nearest() is None


def test_pose_and_velocity_follow_the_commands_and_speeds_are_cut():
    swarm = StepSwarm(1)
    robot = swarm[0]
    for time_s in swarm.rate(10):
        robot.drive(9.0, 1.0)
        if time_s > 1.5:
            break
    assert robot.velocity.linear_m_s == pytest.approx(0.2, abs=0.03)
    assert robot.velocity.angular_rad_s == pytest.approx(1.0, abs=0.4)
    assert robot.pose.yaw_rad > 0.5
    assert robot.age_s("odom") < 0.04 and robot.age_s("proximity") < 0.21
    robot.stop()
    robot.sleep(0.5)
    assert robot.velocity == pytest.approx((0.0, 0.0), abs=0.1)


def test_setting_the_odometry_moves_its_frame_and_not_the_robot():
    swarm = StepSwarm(2)
    robot, common = swarm[1], CommonFrame("world")
    robot.forward(0.1)
    robot.sleep(1.0)  # until its servos rest
    before = robot.true_pose
    robot.set_pose(1.0, -2.0, 0.5)
    assert math.dist(robot.pose, (1.0, -2.0, 0.5)) < 1e-6
    assert robot.true_pose == pytest.approx(before, abs=1e-6)
    assert common.pose_of(robot)[:2] == pytest.approx(before[:2], abs=1e-6)
    assert common.missing == {"hero_1": None}


def test_an_unknown_common_frame_is_reported(capsys):
    swarm, common = StepSwarm(1), CommonFrame("mars")
    assert common.pose_of(swarm[0]) is None
    assert "no transform from hero_0/odom to mars" in common.missing["hero_0"]
    for _ in swarm.rate(10):
        swarm.report_missing(common.missing)
        if swarm.now_s > 9.0:
            break
    assert capsys.readouterr().err.count("hero_0: waiting: no transform") == 2
    swarm.report_missing({"hero_0": None})
    assert capsys.readouterr().err == "hero_0 answers\n"


OPTIONS = {name: "--" + name.replace("_", "-") for name in ("count", "first_id", "seed", "arena", "error", "model")}


@pytest.mark.parametrize(
    "wrong",
    [
        {"count": 0},
        {"count": 1001},
        {"first_id": -1},
        {"count": 2, "first_id": 2**31 - 1},
        {"seed": -1},
        {"seed": 2**32},
        {"arena": "nowhere.yaml"},
        {"count": 500, "arena": "maze"},
        {"error": "slip=2"},
        {"error": "robot=9,slip=0"},
        {"model": "hero_plus,robot=9"},
    ],
    ids=str,
)
def test_wrong_options_are_refused_in_the_words_of_the_command_line(wrong, capsys, monkeypatch):
    monkeypatch.setattr(arena, "_MAX_TRIES", 100)  # so that a full arena is soon found to be full
    with pytest.raises(OptionError) as refused:
        StepSwarm(**{"count": 1, **wrong})
    monkeypatch.setattr(sys, "argv", ["hero_sim"])
    arguments = [OPTIONS[name] + "=" + str(value) for name, value in wrong.items()]
    assert main.main(["--port", "9", *arguments]) in (1, 2)
    assert capsys.readouterr().err.strip() == "hero_sim: %s" % refused.value


def test_options_of_a_wrong_type_are_refused_in_one_line():
    for wrong in ({"count": "3"}, {"count": 1, "seed": 0.5}, {"count": 1, "worlds": 0}, {"count": True}):
        with pytest.raises(OptionError, match=r"(--count|--seed|worlds) .*: must be"):
            StepSwarm(**wrong)
    with pytest.raises(OptionError, match="--wifi 'good': must be one of ideal, router, hotspot, bad"):
        StepSwarm(1, wifi="good")
    assert len(StepSwarm(np.int64(2), seed=np.int64(3))) == 2


def test_waits_take_whole_milliseconds_and_one_at_least():
    swarm = StepSwarm(1)
    for duration_s, taken_ms in ((0.1, 100), (0.0, 0), (1e-9, 1), (0.0301, 31), (0.1 + 0.2, 300), (-1.0, 0)):
        before_ms = swarm.rows.now_ms
        assert swarm.sleep(duration_s)
        assert swarm.rows.now_ms - before_ms == taken_ms


def test_motions_that_are_due_together_take_their_steps_in_order():
    clock, taken = StepClock(RobotRows(build_world(parse_options()))), []

    def note(name):
        while True:
            taken.append(name)
            yield 0.1

    motions = [StepMotion(clock, note(name)) for name in range(30)]
    clock.sleep(0.25)
    assert taken == [*range(30)] * 3
    assert not any(motion.done() for motion in motions)


@pytest.mark.slow
def test_robots_change_places_around_each_other_and_around_one_that_stays(tmp_path):
    arena = tmp_path / "arena.yaml"
    arena.write_text(
        "walls_m: [[[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]]\n"
        "starts_m_deg: [[-0.3, 0, 0], [0.3, 0, 180], [0.0, 0.02, 90]]\n"
    )
    with StepSwarm(3, seed=1, arena=str(arena), perfect=True) as swarm:
        stays = swarm[2].true_pose
        swarm.go_to_each({0: (0.3, 0.0), 1: (-0.3, 0.0)}, frame="world", tolerance_m=0.02)
        assert math.dist(swarm[0].true_pose[:2], (0.3, 0.0)) < 0.03
        assert math.dist(swarm[1].true_pose[:2], (-0.3, 0.0)) < 0.03
        assert math.dist(swarm[2].true_pose[:2], stays[:2]) < 0.01


@pytest.mark.slow
def test_a_bump_shield_is_kept_from_walls_and_from_other_robots(tmp_path):
    arena = tmp_path / "arena.yaml"
    arena.write_text(
        "walls_m: [[[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]]\nstarts_m_deg: [[-0.3, 0, 0], [0.3, 0, 180]]\n"
    )
    with StepSwarm(2, seed=3, arena=str(arena), model="hero_plus") as swarm:
        radius_m, log = swarm.max_body_radius_m, swarm.log()
        swarm.go_to_each({0: (0.3, 0.0), 1: (-0.3, 0.0)}, frame="world", tolerance_m=0.02)
        path = log.true_pose[:, 0, :, :2]
        assert np.hypot(*(path[:, 0] - path[:, 1]).T).min() > 2.0 * radius_m + 0.02
        with pytest.raises(GoalError, match=r"0.0[78] m from the robot's center"):
            swarm[0].go_to(2.0, 0.0, frame="world")
        assert swarm[0].true_pose.x_m < 1.0 - radius_m - 0.005


def test_arrays_hold_what_the_robots_read_one_by_one():
    with StepSwarm(3, seed=2, arena="obstacles") as swarm:
        swarm.drive(0.1, 0.5, duration_s=1.0)
        assert swarm.pose_array.tolist() == [list(robot.pose) for robot in swarm]
        assert swarm.velocity_array.tolist() == [list(robot.velocity) for robot in swarm]
        assert swarm.proximity_array.tolist() == [robot.proximity for robot in swarm]


def test_wheel_speeds_and_infrared_counts_fit_velocity_and_ranges(tmp_path):
    arena = tmp_path / "wall.yaml"
    arena.write_text("walls_m: [[[-2, 0.1], [2, 0.1]]]\nstarts_m_deg: [[0, 0, 0]]\n")  # to the left
    robot = StepSwarm(1, perfect=True, arena=str(arena))[0]
    robot.drive(0.0, 2.0)
    robot.sleep(0.15)  # hardly turned yet
    counts = robot.infrared_counts
    assert counts.index(max(counts)) == 2 and min(robot.proximity) == robot.proximity[2]
    robot.sleep(1.0)
    left_m_s, right_m_s = robot.wheel_speeds
    assert left_m_s < 0.0 < right_m_s and right_m_s - left_m_s == pytest.approx(2.0 * 0.063, abs=0.04)  # whole ticks


def test_a_log_names_what_robots_did_by_time_world_and_robot():
    with StepSwarm(3, seed=1, worlds=2) as swarm:
        log = swarm.log()
        swarm[1].drive(0.1, 0.5)
        swarm.sleep(0.5)
        assert log.time_s.tolist() == pytest.approx([index * 0.05 for index in range(11)])
        assert log.true_pose.shape == log.pose.shape == (11, 2, 3, 3)
        assert log.command[-1].tolist() == [[[0.0, 0.0], [0.1, 0.5], [0.0, 0.0]], [[0.0, 0.0]] * 3]
        assert tuple(log.true_pose[-1, 0, 1]) == swarm[1].true_pose and log.velocity[-1, 0, 1, 0] > 0.0
        with pytest.raises(AttributeError, match="range_m on request"):
            assert log.range_m
