"""Models of the robot: what each declares and sends, and that the driver's odometry fits each."""

import math
import struct

import numpy as np
import pytest
from driver_side import DriverSide

from hero_driver.corrections import PLUS_WHEELS, WheelGeometry
from hero_driver.corrections.message_layouts import drop_tick_difference, read_encoder
from hero_driver.corrections.tick_odometry import TickOdometry
from hero_driver.rosserial import packets, payloads
from hero_node.ros_messages import PLUS_ENCODER_MD5
from hero_sim.robot.models import MODELS
from hero_sim.world.arena import build_rectangle
from hero_sim.world.robot_errors import draw_errors
from hero_sim.world.world import World
from hero_test.nonempty import nonempty

NEWER = {"ir_calibration", "laser_enable", "motors_parameters"}


def list_infos(driver, index):
    return [payloads.decode_topic_info(arrival.payload) for arrival in driver.arrivals[index] if arrival.topic_id < 4]


def test_the_older_firmware_declares_less_under_ids_without_gaps():
    driver = DriverSide("--model", "v3.0")
    driver.start_streaming()
    infos = list_infos(driver, 0)
    assert not NEWER & {info.name.rpartition("/")[2] for info in infos}
    taken = {info.topic_id for info in infos}
    assert taken == {*range(100, 109), *range(125, 135)}
    assert "Firmware: v3.0" in driver.list_logs(0)[0][1]


def test_hero_plus_declares_its_encoder_and_a_distance_but_no_imu():
    driver = DriverSide("--model", "hero_plus")
    driver.start_streaming()
    md5sums = {info.name.rpartition("/")[2]: info.md5sum for info in list_infos(driver, 0)}
    assert md5sums["encoder"] == PLUS_ENCODER_MD5
    assert "distance" in md5sums and "imu" not in md5sums


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
def test_the_drivers_odometry_of_a_model_is_right_within_one_percent(name):
    model = MODELS[name]
    driver = DriverSide("--perfect", "--model", name, "--error", "slip=0")
    driver.start_streaming()
    start = driver.true_pose(0)
    odometry = TickOdometry(PLUS_WHEELS if model.is_plus else WheelGeometry())
    since_ms = driver.swarm.now_ms
    twist_id, encoder_id = model.received_ids["velocity_controller/cmd_vel"], model.sent_ids["encoder"]
    driver.drive(0, 0.1, 0.5, 3000, twist_id)
    driver.drive(0, 0.0, 0.0, 600, twist_id)
    for arrival in driver.list_packets(0, encoder_id, since_ms):
        payload = drop_tick_difference(arrival.payload) if model.is_plus else arrival.payload
        stamp_ns, left_ticks, right_ticks = read_encoder(payload)
        odometry.integrate(left_ticks, right_ticks, stamp_ns / 1e9)
    x_m, y_m, yaw_rad = driver.true_pose(0)
    path_m = math.hypot(x_m - start[0], y_m - start[1])
    assert path_m > 0.2
    assert math.hypot(odometry.x_m, odometry.y_m) == pytest.approx(path_m, rel=0.01)
    assert odometry.yaw_rad == pytest.approx(yaw_rad - start[2], rel=0.01)


@pytest.mark.slow
def test_hero_plus_measures_the_distance_ahead_twenty_times_a_second():
    driver = DriverSide("--perfect", "--model", "hero_plus", "--arena", "empty")
    driver.start_streaming()
    since_ms = driver.swarm.now_ms
    driver.run(1000)
    readings = driver.list_packets(0, MODELS["hero_plus"].sent_ids["distance"], since_ms)
    assert 19 <= len(readings) <= 21
    x_m, _, theta_rad = driver.true_pose(0)
    assert theta_rad == 0.0
    (mean_m,) = np.mean([struct.unpack("<f", arrival.payload) for arrival in readings], axis=0)
    assert mean_m == pytest.approx(1.0 - x_m, abs=0.01)


def test_a_service_of_the_older_firmware_is_answered_under_its_own_id():
    driver = DriverSide("--model", "v3.0")
    driver.start_streaming()
    model = MODELS["v3.0"]
    driver.send(0, model.received_ids["set_odom"], struct.pack("<3d", 1.0, 2.0, 0.0))
    driver.run(200)
    assert len(driver.list_packets(0, model.sent_ids["set_odom"])) == 1
    assert driver.swarm.robots[0].sensing.odometry.pose[:2] == (1.0, 2.0)


@pytest.mark.slow
def test_one_swarm_holds_robots_of_several_models():
    driver = DriverSide("--count", "3", "--first-id", "5", "--model", "hero_plus,robot=6", "--model", "v3.0,robot=7")
    driver.start_streaming()
    assert [robot.model for robot in driver.swarm.robots] == [MODELS[name] for name in ("hero", "hero_plus", "v3.0")]
    assert all(any(packet.topic_id == packets.ID_LOG for packet in sent) for sent in nonempty(driver.arrivals))


@pytest.mark.slow
def test_a_robot_with_a_bump_shield_keeps_others_and_walls_farther_away():
    errors = draw_errors([np.random.RandomState(index) for index in range(2)], 0.0)
    errors.radius_m[0] = 0.060
    errors.wheel_friction[0] = 1.0  # it pushes the other one
    poses = np.array([(0.0, 0.0, 0.0), (0.2, 0.0, 0.0)])
    world = World(build_rectangle(1.0, 1.0, 1), poses, [np.random.RandomState(0)], errors)
    world.speeds_m_s[0] = world.commands_m_s[0] = 0.1
    for _ in range(300):
        world.step()
        assert world.measure_overlaps()[0].max() < 5e-4
    assert world.poses[1, 0] - world.poses[0, 0] == pytest.approx(0.060 + 0.036835, abs=1e-3)
    for _ in range(3000):
        world.step()
    assert world.poses[1, 0] == pytest.approx(0.5 - 0.036835, abs=1e-3)
