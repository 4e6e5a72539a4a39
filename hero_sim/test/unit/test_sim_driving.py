import math
import struct

import pytest
from driver_side import POSITION, RECEIVED, SENT, VELOCITY, DriverSide, read_encoder, read_odom

from hero_driver.rosserial import packets
from hero_node import Pose, find_frame
from hero_sim.robot.imu_hat import ImuHat
from hero_sim.robot_constants import RECEIVE_WINDOW_LENGTH

both_controllers = pytest.mark.parametrize("controller", [VELOCITY, POSITION], ids=["velocity", "position"])


def test_tx_stop_leaves_log_lines_and_a_moving_robot_runs_away():
    driver = DriverSide("--perfect")
    driver.start_streaming()
    driver.drive(0, 0.1, 0.0, 600)
    driver.send(0, packets.ID_TX_STOP)
    driver.run(500)
    since_ms = driver.swarm.now_ms
    driver.run(1500)
    assert {arrival.topic_id for arrival in driver.arrivals[0] if arrival.at_ms > since_ms} == {packets.ID_LOG}
    # 0.06 m/s on the stock robot; where in its cycle the stop comes makes the difference.
    assert 0.03 < driver.measure_speed(0) < 0.10


@pytest.mark.parametrize(
    "topic_id, payload, seconds",
    [
        (VELOCITY, struct.pack("<6d", 0.1, 0, 0, 0, 0, 0), 2.0),
        (POSITION, struct.pack("<6d", 0.1, 0, 0, 0, 0, 0), 4.0),
        (RECEIVED["cmd_motor"], struct.pack("<2h", 1600, 1600), 1.0),
    ],
    ids=["velocity", "position", "motor"],
)
def test_a_single_command_ends_by_its_watchdog(topic_id, payload, seconds):
    driver = DriverSide("--perfect")
    driver.start_streaming()
    motors = driver.swarm.robots[0].motors.motors
    driver.send(0, topic_id, payload)
    while not motors.attached:
        driver.run(1)
    start_ms = driver.swarm.now_ms
    while motors.attached:
        driver.run(1)
    # The last write of a controller comes up to 21 ms before its own watchdog ends it.
    assert seconds * 1000 - 21 <= driver.swarm.now_ms - start_ms <= seconds * 1000 + 2
    driver.run(600)
    assert driver.measure_speed(0) < 0.001


def test_one_velocity_command_drives_as_far_as_the_stock_robot():
    driver = DriverSide("--perfect")
    driver.start_streaming()
    start_m = driver.true_pose(0)[0]
    driver.send_twist(0, 0.1, 0.0)
    driver.run(4000)
    assert 0.13 <= driver.true_pose(0)[0] - start_m <= 0.17


@pytest.mark.parametrize("linear_m_s, turn_rad_s", [(5.0, 0.0), (0.0, -100.0)], ids=["linear", "turn"])
def test_speeds_are_limited(linear_m_s, turn_rad_s):
    driver = DriverSide("--perfect")
    driver.start_streaming()
    driver.drive(0, linear_m_s, turn_rad_s, 3000)
    before = driver.swarm.world.travels_m[0].copy()
    driver.drive(0, linear_m_s, turn_rad_s, 3000)
    left_m_s, right_m_s = (driver.swarm.world.travels_m[0] - before) / 3.0
    assert (left_m_s + right_m_s) / 2.0 == pytest.approx(0.20 if linear_m_s else 0.0, abs=0.008)
    assert (right_m_s - left_m_s) / 0.063 == pytest.approx(0.0 if linear_m_s else -8.0, abs=0.4)


def test_a_stop_stops():
    driver = DriverSide()
    driver.start_streaming()
    driver.drive(0, 0.1, 0.0, 1500)
    driver.send_twist(0, 0.0, 0.0)
    driver.run(400)
    assert driver.measure_speed(0) < 0.002
    assert "\x1b[93m[/hero_0] Reseting PID...\x1b[0m" in [text for _, text in driver.list_logs(0)]


def test_a_stop_within_50_ms_of_the_last_command_is_dropped():
    driver = DriverSide()
    driver.start_streaming()
    driver.drive(0, 0.1, 0.0, 1000)
    move = packets.encode_packet(VELOCITY, struct.pack("<6d", 0.1, 0, 0, 0, 0, 0))
    driver.run(60)
    driver.send_bytes(0, move)
    driver.send_twist(0, 0.0, 0.0)
    driver.run(600)
    assert driver.measure_speed(0) > 0.03
    driver.send_twist(0, 0.0, 0.0)
    driver.run(400)
    assert driver.measure_speed(0) < 0.002


def test_a_motion_right_behind_an_accepted_zero_is_accepted():
    driver = DriverSide()
    driver.start_streaming()
    driver.drive(0, 0.1, 0.0, 1000)
    driver.run(60)
    driver.send_twist(0, 0.0, 0.0)
    driver.send_twist(0, 0.1, 0.0)
    driver.run(600)
    assert driver.measure_speed(0) > 0.03


@both_controllers
def test_a_robot_that_was_frozen_drops_zeros_that_waited_behind_a_motion(controller):
    driver = DriverSide("--perfect")
    driver.start_streaming()
    driver.swarm.robots[0].freeze(driver.swarm.now_ms, 500)
    driver.swarm.reschedule(0)
    for linear_m_s in (0.1, 0.0, 0.0):
        driver.send_twist(0, linear_m_s, 0.0, controller)
        driver.run(150)
    driver.run(600)
    assert driver.measure_speed(0) > 0.03
    assert not [text for _, text in driver.list_logs(0) if "Reseting" in text]


def test_what_waited_beyond_the_receive_window_is_read_in_the_next_spin():
    driver = DriverSide("--perfect")
    driver.start_streaming()
    driver.swarm.robots[0].freeze(driver.swarm.now_ms, 500)
    driver.swarm.reschedule(0)
    move = struct.pack("<6d", 0.1, 0, 0, 0, 0, 0)
    for _ in range(RECEIVE_WINDOW_LENGTH // 56 + 1):
        driver.send(0, VELOCITY, move)
    driver.send_twist(0, 0.0, 0.0)
    driver.run(540)
    assert driver.measure_speed(0) > 0.01
    driver.run(600)
    assert driver.measure_speed(0) < 0.001


def test_a_command_that_is_not_finite_is_reported_and_changes_nothing():
    driver = DriverSide()
    driver.start_streaming()
    driver.send_twist(0, float("nan"), 0.0)
    driver.send(0, VELOCITY, b"short")
    driver.run(200)
    assert driver.measure_speed(0) == 0.0
    assert [report.split(" with ")[0] for report in driver.reports] == [
        "hero_0: geometry_msgs/Twist",
        "hero_0: geometry_msgs/Twist has 5 bytes instead of 48",
    ]


@pytest.mark.parametrize("controller, least, most", [(VELOCITY, 0.38, 0.70), (POSITION, 0.97, 1.03)])
def test_odometry_loses_distance_while_the_velocity_controller_drives(controller, least, most):
    driver = DriverSide("--perfect")
    driver.start_streaming()
    start_m = driver.true_pose(0)[0]
    driver.drive(0, 0.1, 0.0, 5000, controller)
    driver.send_twist(0, 0.0, 0.0, controller)
    driver.run(1000)
    true_m = driver.true_pose(0)[0] - start_m
    odom_m = read_odom(driver.list_packets(0, SENT["odom"])[-1].payload)[2][0]
    assert true_m > 0.3
    assert least <= odom_m / true_m <= most


def test_the_ticks_lose_nothing():
    driver = DriverSide("--perfect")
    driver.start_streaming()
    start_m = driver.true_pose(0)[0]
    driver.drive(0, 0.1, 0.0, 5000)
    driver.send_twist(0, 0.0, 0.0)
    driver.run(1000)
    true_m = driver.true_pose(0)[0] - start_m
    # Without slip and wheel errors only a tick may be missing.
    encoder = read_encoder(driver.list_packets(0, SENT["encoder"])[-1].payload)
    assert encoder[0] * 0.00053669 == pytest.approx(true_m, abs=0.002)


def test_set_odom_sets_the_pose_zeroes_the_ticks_and_answers_in_time():
    driver = DriverSide("--perfect")
    driver.start_streaming()
    driver.drive(0, 0.1, 0.0, 1000)
    driver.send_twist(0, 0.0, 0.0)
    driver.run(1000)
    called_ms = driver.swarm.now_ms
    driver.send(0, RECEIVED["set_odom"], struct.pack("<3d", 1.0, 2.0, 0.5))
    driver.run(200)
    (answer,) = driver.list_packets(0, SENT["set_odom"])
    assert answer.payload == b"\x01\x15\x00\x00\x00Odometry was changed!"
    assert 42 <= answer.at_ms - called_ms <= 75 + 1
    pose = read_odom(driver.list_packets(0, SENT["odom"])[-1].payload)[2]
    assert pose == pytest.approx((1.0, 2.0, 0.247404, 0.968912), abs=1e-6)
    assert read_encoder(driver.list_packets(0, SENT["encoder"])[-1].payload)[:2] == (0.0, 0.0)
    assert "[HERO] Odometry was changed!" in [text for _, text in driver.list_logs(0)]


def test_a_server_that_does_not_read_blocks_the_robot_and_its_watchdogs():
    driver = DriverSide("--perfect")
    driver.start_streaming()
    driver.drive(0, 0.1, 0.0, 1500)
    robot = driver.swarm.robots[0]
    robot.block_writing(driver.swarm.now_ms)
    driver.swarm.reschedule(0)
    since_ms = driver.swarm.now_ms
    driver.run(4900)
    assert not driver.list_packets(0, SENT["odom"], since_ms + 1)
    assert driver.measure_speed(0) > 0.05
    driver.run(4000)
    assert driver.measure_speed(0) < 0.002
    assert driver.list_packets(0, SENT["odom"], since_ms + 5000)


def test_a_frozen_robot_keeps_its_pulses_and_then_resumes_its_command():
    driver = DriverSide("--perfect")
    driver.start_streaming()
    driver.send_twist(0, 0.1, 0.0)
    driver.run(150)
    driver.swarm.robots[0].freeze(driver.swarm.now_ms, 500)
    driver.swarm.reschedule(0)
    commands_m_s = driver.swarm.world.commands_m_s[0].tolist()
    driver.run(490)
    assert driver.swarm.world.commands_m_s[0].tolist() == commands_m_s
    assert driver.measure_speed(0) > 0.02
    driver.run(200)
    assert driver.swarm.world.commands_m_s[0].tolist() != commands_m_s


def test_a_robot_with_an_imu_takes_its_yaw_from_it_not_from_set_odom():
    driver = DriverSide("--imu-hat", "--perfect")
    driver.start_streaming()
    driver.drive(0, 0.0, 1.0, 2000)
    driver.send_twist(0, 0.0, 0.0)
    driver.send(0, RECEIVED["set_odom"], struct.pack("<3d", 0.0, 0.0, -2.0))
    driver.run(1000)
    _, _, _, turn_w = read_odom(driver.list_packets(0, SENT["odom"])[-1].payload)[2]
    assert 2.0 * math.acos(turn_w) == pytest.approx(driver.true_pose(0)[2], abs=0.01)


def test_imu_readings_are_up_to_a_quarter_of_a_second_old():
    hat = ImuHat(0.0)
    ages_s = [now_ms / 1000.0 - hat.read(now_ms, now_ms / 1000.0, 1.0)[0] for now_ms in range(0, 3000, 34)]
    assert 0.15 < max(ages_s) <= 0.25
    assert min(ages_s) == pytest.approx(0.0, abs=0.035)


def test_the_queue_of_the_imu_gives_a_reading_every_ten_milliseconds():
    hat = ImuHat(0.5)
    first, second, third = (hat.read(now_ms, 0.5 + now_ms / 100.0, now_ms / 10.0) for now_ms in (20, 40, 60))
    assert first == second == pytest.approx((0.2, round(2.0 * 16.4 * 180.0 / math.pi)))
    assert third == pytest.approx((0.4, round(4.0 * 16.4 * 180.0 / math.pi))), "the first one not before 30 ms"
    hat = ImuHat(0.5)
    assert [round(hat.read(now_ms, 0.5 + now_ms / 100.0, 0.0)[0], 9) for now_ms in (19, 39)] == [0.19, 0.39]


def test_the_odom_frame_survives_a_restart_and_follows_set_odom():
    driver = DriverSide("--perfect")
    driver.start_streaming()
    robot = driver.swarm.robots[0]
    start = driver.true_pose(0)
    driver.drive(0, 0.1, 0.5, 3000, POSITION)
    driver.send_twist(0, 0.0, 0.0, POSITION)
    driver.run(1000)
    robot.switch_on(driver.swarm.now_ms)
    assert robot.body.odom_origin == pytest.approx(start)
    driver.swarm.reschedule(0)
    driver.start_streaming()
    driver.send(0, RECEIVED["set_odom"], struct.pack("<3d", 0.5, 0.0, 1.0))
    driver.run(200)
    assert robot.body.odom_origin == pytest.approx(find_frame(Pose(*driver.true_pose(0)), Pose(0.5, 0.0, 1.0)))
