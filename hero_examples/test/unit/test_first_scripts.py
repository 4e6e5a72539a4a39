"""The first scripts in virtual time: what each does, with the robots of many seeds."""

import math
import re

import numpy as np
import pytest
import true_paths

from hero_examples.first import all_robots, avoid, drive_a_square, move, read_sensors
from hero_sim.stepped import StepSwarm
from hero_sim.world import load_arena
from hero_test.nonempty import nonempty

pytest.importorskip("rospy", reason="the scripts' robots are on ROS")

WORLDS = 4


def step_all(swarm, step):
    """Return a function that takes a script's step for each robot of all worlds."""

    def step_each(time_s):
        for robot in swarm:
            step(robot)

    return step_each


@pytest.mark.parametrize("seed", range(2))
def test_move_drives_forward_and_turns_left(seed):
    with StepSwarm(1, seed=seed) as swarm:
        before = swarm[0].true_pose
        move.move(swarm[0])
        after = swarm[0].true_pose
    assert 0.12 < math.dist(before[:2], after[:2]) < 0.22
    assert 0.5 < after.yaw_rad - before.yaw_rad < 1.6
    assert true_paths.stop_within(swarm)


def test_read_sensors_turns_and_prints_what_is_seen(capsys):
    with StepSwarm(1) as swarm:
        path = true_paths.run(swarm, step_all(swarm, read_sensors.step), 5.0, hz=2.0)[0]
    assert path[-1, 0, 2] - path[0, 0, 2] == pytest.approx(0.6 * 5.0, abs=0.8)
    text = capsys.readouterr().out
    for pattern in (r"pose: x -?0.\d\d m, y ", r"ranges from the front, .*\['", r"nearest: (None|Obstacle)"):
        assert len(re.findall(pattern, text)) == 10


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_the_square_is_closed_and_the_light_blinks(seed):
    with StepSwarm(1, seed=seed) as swarm:
        log = swarm.log()
        lights = []
        swarm.rows.on_cycle.append(lambda rows: lights.append(swarm[0].light))
        drive_a_square.drive_a_square(swarm[0])
    offsets = log.true_pose[:, 0, 0, :2] - log.true_pose[0, 0, 0, :2]
    assert math.hypot(*offsets[-1]) < 0.05
    assert np.hypot(*offsets.T).max() == pytest.approx(0.2 * math.sqrt(2.0), abs=0.03)
    changes = sum(one != next_one for one, next_one in zip(lights, lights[1:]))
    assert set(lights) == {(0.0, 0.0, 0.0), (0.0, 1.0, 0.0)} and changes > 50
    assert lights[-1] == (0.0, 0.0, 0.0)


@pytest.mark.slow
def test_avoid_keeps_driving_and_touches_nothing_that_it_sees():
    with StepSwarm(1, seed=1, arena="obstacles", worlds=WORLDS) as swarm:
        paths = true_paths.run(swarm, step_all(swarm, avoid.step), 60.0)
    for path in nonempty(paths):
        assert true_paths.list_touches(path, load_arena("obstacles")) == []
        assert true_paths.measure_lengths(path).min() > 1.0


def test_all_robots_turns_every_robot_in_a_color_of_its_own():
    with StepSwarm(5) as swarm:
        before = [robot.true_pose.yaw_rad for robot in swarm]
        seen = set()
        swarm.rows.on_cycle.append(lambda rows: seen.add(tuple(robot.light for robot in swarm)))
        all_robots.turn_all(swarm)
        swarm.sleep(0.2)
        for robot, yaw_rad in nonempty(zip(swarm, before)):
            assert robot.true_pose.yaw_rad - yaw_rad > 0.8
            assert robot.light == (0.0, 0.0, 0.0)
    assert any(len(set(lights)) == 5 for lights in seen)


@pytest.mark.slow
def test_robots_that_are_not_calibrated_wait_and_drive_once_they_are():
    with StepSwarm(1, seed=1, arena="obstacles", worlds=4) as swarm:
        calibrations = swarm.rows._calibration_counts_m2.copy()
        for row in range(4):
            swarm.rows.set_infrared_calibration(row, np.full(8, math.nan))
        swarm.sleep(0.3)  # the next scan
        for path in nonempty(true_paths.run(swarm, step_all(swarm, avoid.step), 10.0)):
            assert np.ptp(path, axis=0).max() < 1e-6
        for row, calibration in enumerate(calibrations):
            swarm.rows.set_infrared_calibration(row, calibration)
        swarm.sleep(0.3)
        for path in nonempty(true_paths.run(swarm, step_all(swarm, avoid.step), 3.0)):
            assert true_paths.measure_lengths(path).min() > 0.03


def test_avoid_turns_where_only_the_front_is_not_calibrated():
    robot = Noting((math.nan, *[math.inf] * 7))
    avoid.step(robot)
    assert robot.told == [("drive", 0.0, -1.5)]


class Noting:
    """A robot that sees what a test says, and notes what it is told."""

    def __init__(self, ranges_m=(math.inf,) * 8):
        self.proximity, self.told = ranges_m, []
        self.pose = (0.1, -0.2, 0.3)

    def nearest(self):
        return None

    def stop_if_blind(self):
        return False

    def __iter__(self):
        return iter(self.robots)

    def __len__(self):
        return len(self.robots)

    def __getattr__(self, name):
        return lambda *arguments, **options: self.told.append((name, *arguments, *options.values()))


def test_steps_command_what_their_lines_say():
    free, near = math.inf, 0.149
    for front, front_left, front_right, expected in (
        (free, free, free, (0.08, 0.0)),
        (0.15, 0.15, 0.15, (0.08, 0.0)),
        (near, free, 0.2, (0.0, 1.5)),
        (near, 0.2, free, (0.0, -1.5)),
        (free, near, free, (0.0, -1.5)),
        (free, free, near, (0.0, 1.5)),
        (near, 0.2, 0.2, (0.0, -1.5)),
    ):
        robot = Noting((front, front_left, near, near, near, near, near, front_right))
        avoid.step(robot)
        assert robot.told == [("drive", *expected)], (front, front_left, front_right)
    robot = Noting()
    read_sensors.step(robot)
    assert robot.told == [("drive", 0.0, 0.6)]
    robot = Noting()
    move.move(robot)
    assert robot.told == [("wait_until_ready",), ("drive", 0.1, 0.0, 2.0), ("drive", 0.0, 1.5, 1.0)]
    swarm = Noting()
    swarm.robots = [Noting() for _ in range(3)]
    all_robots.turn_all(swarm)
    assert swarm.told == [("wait_until_ready",), ("drive", 0.0, 1.0, 1.5), ("led", "off")]
    assert [robot.told for robot in swarm] == [[("led", color)] for color in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
    robot = Noting()
    drive_a_square.drive_a_square(robot)
    assert robot.told == [("blink", "green", 0.5)] + [("forward", 0.2), ("turn", math.pi / 2.0)] * 4
