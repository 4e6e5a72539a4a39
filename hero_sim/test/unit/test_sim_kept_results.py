"""Results that are kept: robots of every model, driven at random, do what they did (see kept_results)."""

import itertools
import struct

import numpy as np
import pytest
from driver_side import DriverSide

from hero_driver.rosserial import packets
from hero_node import Pose
from hero_sim.stepped.swarm import StepSwarm
from hero_sim.world.arena import Arena, build_rectangle, outline
from hero_sim.world.pushing.shapes import Disc, Polygon, PushedBody
from hero_sim.world.robot_errors import RobotErrors, draw_errors
from hero_sim.world.world import World
from hero_test.checks.kept_results import Digest

# -- robots in process ---------------------------------------------------------------------------------------


def act(rng, rows):
    """Do something to some robots."""
    some = rng.permutation(len(rows.ticks))[: 1 + rng.randint(len(rows.ticks))]
    row, deed = int(some[0]), rng.randint(10)
    twists = rng.randint(-25, 26, (2, len(some))) * np.array([[0.01], [0.3]])
    if deed < 2:
        rows.send_velocity(some, *twists)
    elif deed == 2:
        rows.send_velocity(np.arange(len(rows.ticks)), *twists[:, 0])
    elif deed == 3:
        rows.send_position(row, *twists[:, 0].tolist())
    elif deed == 4:
        rows.send_pulses(some, *rng.randint(900, 2100, (2, len(some))))
    elif deed == 5:
        rows.send_velocity(some, 0.0, 0.0)
        rows.send_light(some, rng.randint(0, 2, 4))
    elif deed == 6:
        rows.set_odometry(row, *(rng.randint(-300, 301, 3) * 0.01).tolist())
    elif deed == 7:
        for one in (*some, row):
            rows.send_velocity(int(one), *twists[:, one % len(some)].tolist())
    elif deed == 8:
        rows.set_velocity_gains(row, (rng.randint(-20, 200, 6) * 10.0).tolist())
        rows.set_motor_centers(row, rng.randint(1480, 1521, 2).tolist())
    else:
        rows.set_infrared_calibration(row, rng.randint(3, 9, 8) * 0.1)


def wander_in_process(arena, wifi, seconds):
    """Return where the first robots are at the end by their odometry, and the sum of all readings."""
    models = ["hero_plus,robot=1", "v3.0,robot=2"]
    swarm = StepSwarm(4, seed=4, arena=arena, wifi=wifi, worlds=2, model=models, error="robot=3,slip=0.1")
    rows, rng, digest = swarm.rows, np.random.RandomState(5), Digest()
    for name, hooks in (("cycle", rows.on_cycle), ("scan", rows.on_scan), ("distance", rows.on_distance)):
        hooks.append(lambda which, name=name: digest.add(name, rows.now_ms, which))
    while rows.now_ms < 1000 * seconds:
        act(rng, rows)
        rows.advance(rows.now_ms + int(rng.randint(1, 250)))
        digest.add(rows.odometry, rows.velocities, rows.ticks, rows.lights, rows.commands, rows.odometry_ms)
        digest.add(rows.proximity_m, rows.ranges_m, rows.counts, rows.distance_m, rows.scan_ms, rows.distance_ms)
        digest.add(rows.world.poses, rows.world.object_poses, rows.world.travels_m, rows.world.measure_body_speeds())
    return f"{np.round(rows.odometry[:2], 3).tolist()} {digest}"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arena", "wifi", "kept"),
    [
        ("discs", "ideal", "[[-1.698, 1.415, -2.189], [1.038, 2.951, 0.086]] fdc3b631a27b3681"),
        ("obstacles", "bad,channels=2", "[[-1.698, 1.415, -2.215], [1.071, 2.962, 0.363]] 3233486fd71edafb"),
    ],
    ids=["discs", "obstacles"],
)
def test_robots_in_process_do_what_they_did(arena, wifi, kept):
    assert wander_in_process(arena, wifi, 8) == kept


# -- robots behind sockets -----------------------------------------------------------------------------------


def list_payloads(rng, model):
    """Return what a driver could send to a robot of a model at random: ids and payloads."""
    ids, twist = model.received_ids, rng.randint(-25, 26, 2) * (0.01, 0.3)
    sent = [
        ("led", struct.pack("<4f", *rng.randint(0, 2, 4))),
        ("laser_enable", bytes([rng.randint(3) > 0])),
        ("ir_calibration", struct.pack("<8d", *rng.randint(3, 9, 8) * 0.1)),
        ("set_odom", struct.pack("<3d", *rng.randint(-300, 301, 3) * 0.01)),
        ("cmd_motor", struct.pack("<2h", *rng.randint(900, 2100, 2))),
        ("motors_parameters", struct.pack("<2h", *rng.randint(1480, 1521, 2))),
    ]
    for kind in ("velocity_controller/", "position_controller/"):
        sent += 3 * [(kind + "cmd_vel", struct.pack("<6d", twist[0], 0, 0, 0, 0, twist[1]))]
        sent += [(kind + "cmd_vel", bytes(48))]
        sent += [(kind + "pid_parameters", struct.pack("<6f", *rng.randint(-2, 200, 6) * 10.0))]
        sent += [(kind + "pid_calibration", b"")]
    return [(ids[key], payload) for key, payload in sent if key in ids]


def converse(seed, seconds, *arguments):
    """Return how many packets each robot has sent, and the sum of their times and contents."""
    driver, rng, digest = DriverSide("--seed", str(seed), *arguments), np.random.RandomState(seed), Digest()
    driver.run(2300)
    for index in range(len(driver.swarm.robots)):
        driver.send(index, packets.ID_PUBLISHER)
    while driver.swarm.now_ms < 1000 * seconds:
        index, chance = int(rng.randint(len(driver.swarm.robots))), rng.randint(100)
        robot, now_ms = driver.swarm.robots[index], driver.swarm.now_ms
        if chance < 2:
            robot.switch_off()
            robot.switch_on(now_ms + 10)
        elif chance < 5:
            robot.connection_lost()
        elif chance < 7:
            robot.freeze(now_ms, 300)
        elif chance < 9:
            robot.block_writing(now_ms)
        elif chance < 12:
            robot.unblock_writing(now_ms)
        elif chance < 14:
            driver.send(index, packets.ID_TX_STOP)
        elif chance < 18:
            driver.send(index, packets.ID_PUBLISHER)
        else:
            choices = list_payloads(rng, robot.model)
            for topic_id, payload in [choices[rng.randint(len(choices))] for _ in range(1 + rng.randint(2))]:
                driver.send(index, topic_id, payload)
        driver.connect = rng.randint(4) > 0
        driver.swarm.reschedule(index)
        driver.run(int(rng.randint(1, 200)))
        digest.add(driver.swarm.world.commands_m_s, np.array([robot.due_ms for robot in driver.swarm.robots]))
        digest.add([robot.sensing.show_light(robot.to_millis(driver.swarm.now_ms)) for robot in driver.swarm.robots])
    for arrivals in driver.arrivals:
        digest.add(*itertools.chain.from_iterable(arrivals))
    digest.add(*driver.reports)
    return f"{[len(arrivals) for arrivals in driver.arrivals]} {digest}"


@pytest.mark.slow
def test_robots_send_what_they_sent():
    models = ["--model", "hero_plus,robot=8", "--model", "v3.0,robot=9"]
    kept = "[1722, 3110, 5141, 2840] 35f4b529ab709904"
    assert converse(3, 25, "--count", "4", "--first-id", "7", "--servo-timing", "drawn", *models) == kept


@pytest.mark.slow
def test_robots_with_factory_settings_and_the_imu_hat_send_what_they_sent():
    kept = "[5608, 3852] b8befbe8ec66091d"
    options = ("--count", "2", "--imu-hat", "--servo-timing", "core3", "--ir", "factory", "--motors", "factory")
    assert converse(6, 30, *options, "--model", "hero_plus,robot=1") == kept


# -- things that are pushed ----------------------------------------------------------------------------------


def build_crowd():
    """Return two worlds of robots that drive from a ring around things at these, walls and a post."""
    box = Polygon([(0.0, 0.0), (0.14, 0.0), (0.14, 0.1), (0.0, 0.1)])
    triangle = Polygon([(0.0, 0.0), (0.12, 0.0), (0.04, 0.1)])
    things = [
        PushedBody(box, Pose(0.09, 0.0, 0.4), 0.05, 0.3),
        PushedBody(Disc(0.05), Pose(-0.04, -0.06, 0.0), 0.04, 0.4),
        PushedBody(Disc(0.03), Pose(-0.07, 0.05, 0.0), 0.03, 0.3),
        PushedBody(triangle, Pose(0.02, 0.11, 2.0), 0.04, 0.3),
    ]
    field = build_rectangle(0.56, 0.52, 0)
    walls_m = np.vstack((field.segments_m, outline(np.array([(-0.2, -0.2), (-0.16, -0.22), (-0.17, -0.15)]))))
    walls_m = np.vstack((walls_m, [(0.1, -0.26, 0.1, -0.15)]))
    arena = Arena("crowd", walls_m, np.array([(0.2, 0.2, 0.04)]), (), field.bounds_m, (), tuple(things))
    turns_rad = np.arange(5) * (2.0 * np.pi / 5.0) + np.array([[0.0], [0.5]])
    poses = np.stack((0.2 * np.cos(turns_rad), 0.2 * np.sin(turns_rad), turns_rad + 3.0), axis=-1).reshape(-1, 3)
    errors = [draw_errors([np.random.RandomState([seed, robot]) for robot in range(5)]) for seed in range(2)]
    rngs = [np.random.RandomState(seed) for seed in range(2)]
    # Bits of a cosine depend on the machine.
    return World(arena, np.round(poses, 3), rngs, RobotErrors(*map(np.concatenate, zip(*errors))))


@pytest.mark.slow
def test_things_are_pushed_to_where_they_were():
    world, rng, digest = build_crowd(), np.random.RandomState(7), Digest()
    for step in range(60):
        if step % 10 == 0:
            # Most of them forward.
            world.write_pulses(True, np.array((rng.randint(1200, 1520, 10), rng.randint(1480, 1800, 10))))
        world.step(1 + 2 * (step % 2))
        objects = world.object_poses  # first: whatever is read moves the bodies
        digest.add(world.poses, objects)
        if step % 20 == 0:
            digest.add(world.read_infrared(np.arange(10)), world.read_distances(np.arange(10)))
    kept = "[[0.028, 0.021], [-0.099, -0.026], [-0.086, 0.055], [0.0, 0.115]] 3d876c3ee3ce0130"
    assert f"{np.round(world.object_poses[0, :, :2], 3).tolist()} {digest}" == kept
