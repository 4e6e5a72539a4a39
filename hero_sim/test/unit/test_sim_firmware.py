import math
import struct

import pytest
from driver_side import SERVER_START_S, DriverSide, read_encoder, read_laser, read_odom
from hypothesis import given, settings
from hypothesis import strategies as st

from hero_driver.rosserial import frames, payloads
from hero_sim import declarations as ids
from hero_sim.imu_hat import ImuHat
from hero_sim.kinematics import compose


def test_a_boot_speaks_first_and_at_the_stock_robots_times():
    driver = DriverSide()
    driver.run(5000)
    start_ms = driver.connects[0][0]
    logs = [(at_ms - start_ms, text) for at_ms, text in driver.list_logs(0)]
    assert logs[0] == (
        0,
        "\x1b[94m[/hero_0] Firmware: v3.8 | Hardware: v2.5 | Config: v2.3 | IP: 127.0.0.1 \x1b[0m",
    )
    assert logs[1] == (57, "\x1b[91m[hero_0] IMU is not working or not connected! Error: 1\x1b[0m")
    assert logs[2] == (1120, "\x1b[96m[/hero_0] Conected at time 1638\x1b[0m")
    assert logs[3] == (2139, "\x1b[96m[/hero_0] Conected at time 2657\x1b[0m")


def test_nothing_but_log_lines_comes_before_a_request():
    driver = DriverSide()
    driver.run(10000)
    assert {arrival.topic_id for arrival in driver.arrivals[0]} == {frames.ID_LOG}


def test_a_request_is_answered_by_a_time_request_and_all_declarations_in_one_burst():
    driver = DriverSide()
    driver.run(2500)
    driver.send(0, frames.ID_PUBLISHER)
    driver.run(102)
    burst = [
        arrival
        for arrival in driver.arrivals[0]
        if arrival.topic_id < 7 or arrival.topic_id == frames.ID_TIME
    ]
    assert [arrival.topic_id for arrival in burst[:25]] == [10, 0, 2, 0, 0, 0, 0] + [2] * 6 + [
        1,
        1,
        3,
        3,
        1,
        3,
        1,
        3,
        3,
        1,
        3,
        3,
    ]
    assert len({arrival.at_ms for arrival in burst[:25]}) == 1


def test_a_repeated_request_repeats_the_burst_one_per_spin():
    driver = DriverSide()
    driver.start_streaming()
    driver.arrivals[0].clear()
    driver.send_bytes(0, frames.encode_frame(0, b"") * 3)
    driver.run(300)
    times = [arrival.at_ms for arrival in driver.list_frames(0, 0)][::5]
    assert len(times) == 3
    assert [later - earlier for earlier, later in zip(times, times[1:])] == [51, 51]


def test_a_request_before_the_robot_advertised_gets_no_topics_and_undeclared_data():
    driver = DriverSide()
    while not driver.connects[0]:
        driver.run(1)
    driver.send(0, frames.ID_PUBLISHER)
    driver.run(3000)
    assert len(driver.list_frames(0, frames.ID_TIME)) >= 1
    assert not driver.list_frames(0, frames.ID_PUBLISHER)
    assert driver.list_frames(0, ids.ID_ODOM)
    driver.send(0, frames.ID_PUBLISHER)
    driver.run(200)
    assert len(driver.list_frames(0, frames.ID_PUBLISHER)) == 5


def test_rates_are_the_stock_robots():
    driver = DriverSide()
    driver.start_streaming()
    driver.run(1000)
    since_ms = driver.swarm.now_ms
    driver.run(20000)
    rates = {
        topic_id: (len(got) - 1) / (got[-1].at_ms - got[0].at_ms) * 1000.0
        for topic_id, got in (
            (topic, driver.list_frames(0, topic, since_ms)) for topic in (7, 10, 125, 128, 129, 130)
        )
    }
    assert rates[130] == pytest.approx(29.27, abs=0.05)
    assert rates[128] == pytest.approx(29.27, abs=0.05)
    assert rates[129] == pytest.approx(146.3, abs=0.5)
    assert rates[125] == pytest.approx(4.87, abs=0.02)
    assert rates[7] == pytest.approx(1.0, abs=0.01)
    assert rates[10] == pytest.approx(0.395, abs=0.01)
    assert not driver.list_frames(0, ids.ID_IMU)


def test_the_imu_hat_is_declared_by_all_but_published_only_where_it_is():
    driver = DriverSide("--imu-hat")
    driver.start_streaming()
    driver.run(2000)
    imus = driver.list_frames(0, ids.ID_IMU)
    assert len(imus) == len(driver.list_frames(0, ids.ID_ODOM))
    assert len(imus[0].payload) + 8 == 335
    values = struct.unpack_from("<37d", imus[-1].payload, len(imus[-1].payload) - 37 * 8)
    assert values[3] == 0.99993896484375
    assert values[27] == pytest.approx(8.192)
    assert "IMU hat detected!" in driver.list_logs(0)[1][1]


def test_stamps_are_uptime_before_the_first_answer_and_server_time_after():
    driver = DriverSide()
    driver.start_streaming()
    odoms = driver.list_frames(0, ids.ID_ODOM)
    stamps = [read_odom(arrival.payload)[0] for arrival in odoms]
    assert stamps[0][0] < 10
    assert 1 <= sum(stamp[0] < 10 for stamp in stamps) <= 3
    for arrival, (seconds, nanoseconds) in list(zip(odoms, stamps))[3:]:
        expected_s = SERVER_START_S + arrival.at_ms / 1000.0
        assert seconds + nanoseconds * 1e-9 == pytest.approx(expected_s, abs=0.002)


def test_a_late_answer_puts_the_clock_ahead_by_its_lateness():
    driver = DriverSide(answer_time=False)
    driver.run(2500)
    driver.send(0, frames.ID_PUBLISHER)
    driver.run(400)
    # The answer holds the time at which it is made, 0.3 s and more after the robot asked.
    asked_ms = driver.list_frames(0, frames.ID_TIME)[0].at_ms
    made_ms = driver.swarm.now_ms
    driver.send(0, frames.ID_TIME, payloads.encode_time(driver.server_time()))
    driver.run(200)
    arrival = driver.list_frames(0, ids.ID_ODOM)[-1]
    seconds, nanoseconds = read_odom(arrival.payload)[0]
    ahead_s = seconds + nanoseconds * 1e-9 - (SERVER_START_S + arrival.at_ms / 1000.0)
    assert ahead_s == pytest.approx((made_ms - asked_ms) / 1000.0, abs=0.002)


def test_without_time_answers_a_robot_stops_streaming_after_eleven_seconds_and_a_request_revives_it():
    driver = DriverSide(answer_time=False)
    driver.run(2500)
    driver.send(0, frames.ID_PUBLISHER)
    driver.run(20000)
    asked = [arrival.at_ms for arrival in driver.list_frames(0, frames.ID_TIME)]
    assert len(asked) == 5
    assert all(2501 <= later - earlier <= 2551 for earlier, later in zip(asked, asked[1:]))
    last_ms = driver.list_frames(0, ids.ID_ODOM)[-1].at_ms
    assert last_ms - asked[0] == pytest.approx(11000, abs=60)
    driver.send(0, frames.ID_PUBLISHER)
    driver.run(200)
    assert driver.list_frames(0, ids.ID_ODOM, last_ms + 1)


def test_a_stop_of_transmission_leaves_log_lines_and_lets_a_moving_robot_run_away():
    driver = DriverSide("--perfect")
    driver.start_streaming()
    driver.drive(0, 0.1, 0.0, 600)
    driver.send(0, frames.ID_TX_STOP)
    driver.run(500)
    since_ms = driver.swarm.now_ms
    driver.run(1500)
    assert {arrival.topic_id for arrival in driver.arrivals[0] if arrival.at_ms > since_ms} == {frames.ID_LOG}
    assert driver.measure_speed(0) == pytest.approx(0.06, abs=0.02)


@pytest.mark.parametrize(
    "topic_id, payload, seconds",
    [
        (ids.ID_VELOCITY_CMD_VEL, struct.pack("<6d", 0.1, 0, 0, 0, 0, 0), 2.0),
        (ids.ID_POSITION_CMD_VEL, struct.pack("<6d", 0.1, 0, 0, 0, 0, 0), 4.0),
        (ids.ID_CMD_MOTOR, struct.pack("<2h", 1600, 1600), 1.0),
    ],
    ids=["velocity", "position", "motor"],
)
def test_a_single_command_ends_by_its_watchdog(topic_id, payload, seconds):
    driver = DriverSide("--perfect")
    driver.start_streaming()
    driver.send(0, topic_id, payload)
    while driver.measure_speed(0) == 0.0:
        driver.run(1)
    start_ms = driver.swarm.now_ms
    driver.run(int(seconds * 1000) - 100)
    assert driver.measure_speed(0) > 0.05
    # 51 ms at most from the command to the robot's reading it, then the motor's own lag.
    driver.run(300)
    assert driver.measure_speed(0) < 0.02
    driver.run(1000)
    assert driver.measure_speed(0) == 0.0
    assert start_ms < driver.swarm.now_ms


def test_one_velocity_command_drives_as_far_as_the_stock_robot():
    driver = DriverSide("--perfect")
    driver.start_streaming()
    start_m = driver.true_pose(0)[0]
    driver.send_twist(0, 0.1, 0.0)
    driver.run(4000)
    assert 0.13 <= driver.true_pose(0)[0] - start_m <= 0.17


def test_speeds_are_limited():
    driver = DriverSide("--perfect", "--firmware-odometry", "exact")
    driver.start_streaming()
    driver.drive(0, 5.0, 0.0, 3000, ids.ID_POSITION_CMD_VEL)
    assert driver.measure_speed(0) == pytest.approx(0.20, abs=0.002)
    driver.drive(0, 0.0, -100.0, 3000, ids.ID_POSITION_CMD_VEL)
    assert driver.measure_speed(0) == pytest.approx(8.0 * 0.0315, abs=0.003)


def test_a_stop_stops():
    driver = DriverSide()
    driver.start_streaming()
    driver.drive(0, 0.1, 0.0, 1500)
    driver.send_twist(0, 0.0, 0.0)
    driver.run(400)
    assert driver.measure_speed(0) < 0.002
    assert driver.list_logs(0)[-1][1] == "\x1b[93m[/hero_0] Reseting PID...\x1b[0m"


def test_a_stop_within_50_ms_of_the_last_command_is_dropped():
    driver = DriverSide()
    driver.start_streaming()
    driver.drive(0, 0.1, 0.0, 1000)
    move = frames.encode_frame(ids.ID_VELOCITY_CMD_VEL, struct.pack("<6d", 0.1, 0, 0, 0, 0, 0))
    driver.run(60)
    driver.send_bytes(0, move)
    driver.send_twist(0, 0.0, 0.0)
    driver.run(600)
    assert driver.measure_speed(0) > 0.03
    driver.send_twist(0, 0.0, 0.0)
    driver.run(400)
    assert driver.measure_speed(0) < 0.002


def test_a_command_that_no_robot_could_compute_with_is_reported_and_changes_nothing():
    driver = DriverSide()
    driver.start_streaming()
    driver.send_twist(0, float("nan"), 0.0)
    driver.send(0, ids.ID_VELOCITY_CMD_VEL, b"short")
    driver.run(200)
    assert driver.measure_speed(0) == 0.0
    assert len(driver.reports) == 2 and all(report.startswith("hero_0: Twist") for report in driver.reports)


@pytest.mark.parametrize(
    "controller, least, most", [(ids.ID_VELOCITY_CMD_VEL, 0.38, 0.70), (ids.ID_POSITION_CMD_VEL, 0.97, 1.03)]
)
def test_odometry_loses_distance_while_the_velocity_controller_drives(controller, least, most):
    driver = DriverSide("--perfect")
    driver.start_streaming()
    start_m = driver.true_pose(0)[0]
    driver.drive(0, 0.1, 0.0, 5000, controller)
    driver.send_twist(0, 0.0, 0.0, controller)
    driver.run(1000)
    true_m = driver.true_pose(0)[0] - start_m
    odom_m = read_odom(driver.list_frames(0, ids.ID_ODOM)[-1].payload)[2][0]
    assert true_m > 0.3
    assert least <= odom_m / true_m <= most


def test_exact_odometry_and_the_ticks_lose_nothing():
    driver = DriverSide("--perfect", "--firmware-odometry", "exact")
    driver.start_streaming()
    start_m = driver.true_pose(0)[0]
    driver.drive(0, 0.1, 0.0, 5000)
    driver.send_twist(0, 0.0, 0.0)
    driver.run(1000)
    true_m = driver.true_pose(0)[0] - start_m
    # Without slip and wheel errors only a tick may be missing.
    assert read_odom(driver.list_frames(0, ids.ID_ODOM)[-1].payload)[2][0] == pytest.approx(true_m, abs=0.002)
    encoder = read_encoder(driver.list_frames(0, ids.ID_ENCODER)[-1].payload)
    assert encoder[0] * 0.00053669 == pytest.approx(true_m, abs=0.002)


def test_set_odom_sets_the_pose_and_zeroes_the_ticks_and_answers_in_its_time():
    driver = DriverSide("--perfect")
    driver.start_streaming()
    driver.drive(0, 0.1, 0.0, 1000)
    driver.send_twist(0, 0.0, 0.0)
    driver.run(1000)
    called_ms = driver.swarm.now_ms
    driver.send(0, ids.ID_SET_ODOM, struct.pack("<3d", 1.0, 2.0, 0.5))
    driver.run(200)
    (answer,) = driver.list_frames(0, ids.ID_SET_ODOM_ANSWER)
    assert answer.payload == b"\x01\x15\x00\x00\x00Odometry was changed!"
    assert 42 <= answer.at_ms - called_ms <= 75 + 1
    pose = read_odom(driver.list_frames(0, ids.ID_ODOM)[-1].payload)[2]
    assert pose == pytest.approx((1.0, 2.0, 0.247404, 0.968912), abs=1e-6)
    assert read_encoder(driver.list_frames(0, ids.ID_ENCODER)[-1].payload)[:2] == (0.0, 0.0)
    assert "[HERO] Odometry was changed!" in [text for _, text in driver.list_logs(0)]


def test_self_tuning_answers_without_success_spins_and_floods_the_log_until_a_twist_comes():
    driver = DriverSide("--perfect")
    driver.start_streaming()
    driver.send(0, ids.ID_VELOCITY_PID_CALIBRATION)
    driver.run(2000)
    (answer,) = driver.list_frames(0, ids.ID_VELOCITY_PID_CALIBRATION_ANSWER)
    assert answer.payload == b"\x00\x0f\x00\x00\x00PID Autotuning!"
    assert abs(driver.true_pose(0)[2]) > 1.0
    assert (
        30
        <= sum("Tunning" in text for at_ms, text in driver.list_logs(0) if at_ms > driver.swarm.now_ms - 1000)
        <= 48
    )
    driver.send_twist(0, 0.0, 0.0)
    driver.run(500)
    assert driver.measure_speed(0) < 0.002


def test_parameters_are_kept_over_a_restart(tmp_path):
    driver = DriverSide("--flash-dir", str(tmp_path))
    driver.start_streaming()
    driver.send(0, ids.ID_IR_CALIBRATION, struct.pack("<8d", *[0.4 + 0.01 * index for index in range(8)]))
    driver.run(100)
    driver.send(0, ids.ID_MOTORS_PARAMETERS, struct.pack("<2h", 1490, 1512))
    driver.run(100)
    driver.send(0, ids.ID_VELOCITY_PID_PARAMETERS, struct.pack("<6f", 1, 2, 3, 4, 5, 6))
    driver.run(200)
    for topic_id in (126, 132, 135):
        assert [arrival.payload[0] for arrival in driver.list_frames(0, topic_id)] == [1]
    flash = DriverSide("--flash-dir", str(tmp_path)).swarm.robots[0].flash
    assert flash.ir_calibration_counts_m2 == pytest.approx([0.4 + 0.01 * index for index in range(8)])
    assert flash.motor_centres_us == [1490.0, 1512.0]
    assert flash.velocity_pid == [1, 2, 3, 4, 5, 6]


def test_laser_enable_stops_and_starts_the_laser_and_a_restart_forgets_it():
    driver = DriverSide()
    driver.start_streaming()
    driver.send(0, ids.ID_LASER_ENABLE, b"\x00")
    driver.run(100)
    since_ms = driver.swarm.now_ms
    driver.run(1000)
    assert not driver.list_frames(0, ids.ID_LASER, since_ms)
    driver.send(0, ids.ID_LASER_ENABLE, b"\x01")
    driver.run(1000)
    assert len(driver.list_frames(0, ids.ID_LASER, since_ms)) >= 4


def test_the_laser_sees_the_wall_ahead():
    driver = DriverSide("--perfect")
    driver.start_streaming()
    driver.drive(0, 0.2, 0.0, 8000, ids.ID_POSITION_CMD_VEL)
    _, ranges, counts = read_laser(driver.list_frames(0, ids.ID_LASER)[-1].payload)
    assert ranges[8] == pytest.approx(0.0368 + 0.021, abs=0.01)
    assert counts[8] > 900
    assert ranges[0] > 0.23


def test_the_light_is_blue_after_the_start_then_as_told_and_dark_after_15_s():
    driver = DriverSide()
    driver.start_streaming()
    robot = driver.swarm.robots[0]

    def light():
        return robot.sensing.show_light(robot.to_millis(driver.swarm.now_ms))

    assert light() == (0.0, 0.0, 1.0, 1.0)
    driver.send(0, ids.ID_LED, struct.pack("<4f", 1, 0.5, 0, 1))
    driver.run(14900)
    assert light() == (1.0, 0.5, 0.0, 1.0)
    driver.run(300)
    assert light() == (0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("topic_id", [12, 99, 125, 130, 60000])
def test_an_id_outside_its_table_kills_a_robot(topic_id):
    driver = DriverSide()
    driver.start_streaming()
    driver.send(0, topic_id, b"1234")
    driver.run(100)
    assert "id %d" % topic_id in driver.swarm.robots[0].crash_reason


def test_an_id_in_an_empty_slot_is_ignored():
    driver = DriverSide()
    driver.start_streaming()
    driver.send(0, 120, b"1234")
    driver.run(100)
    assert driver.swarm.robots[0].crash_reason is None


def test_a_frame_in_two_pieces_is_lost_unless_both_come_before_the_robot_looks():
    driver = DriverSide()
    driver.start_streaming()
    frame = frames.encode_frame(ids.ID_LASER_ENABLE, b"\x00")
    driver.send_bytes(0, frame[:5])
    driver.run(60)
    driver.send_bytes(0, frame[5:])
    driver.run(200)
    assert driver.swarm.robots[0].sensing.laser_enabled
    driver.send_bytes(0, frame[:5])
    driver.send_bytes(0, frame[5:])
    driver.run(200)
    assert not driver.swarm.robots[0].sensing.laser_enabled


def test_garbage_from_the_server_does_no_harm():
    driver = DriverSide()
    driver.start_streaming()
    driver.send_bytes(0, bytes(range(256)) * 4)
    driver.run(200)
    driver.send_bytes(0, b"\xff\xfe\xff\xff\x01" + b"x" * 50)
    driver.run(200)
    driver.send(0, ids.ID_LASER_ENABLE, b"\x00")
    driver.run(100)
    assert not driver.swarm.robots[0].sensing.laser_enabled


def test_a_robot_that_lost_its_connection_dials_at_every_look_and_streams_on_at_once():
    driver = DriverSide()
    driver.start_streaming()
    driver.connect = False
    driver.swarm.robots[0].connection_lost()
    since_ms = driver.swarm.now_ms
    driver.run(1000)
    attempts = [at_ms for at_ms in driver.connects[0] if at_ms > since_ms]
    assert 17 <= len(attempts) <= 21
    driver.connect = True
    driver.run(60)
    back_ms = driver.connects[0][-1]
    driver.run(60)
    assert driver.list_frames(0, ids.ID_ODOM, back_ms)[0].at_ms - back_ms <= 35
    assert not driver.list_frames(0, frames.ID_PUBLISHER, back_ms)


def test_robots_started_together_do_the_same_for_the_same_seed():
    runs = []
    for _ in range(2):
        driver = DriverSide("--robots", "6", "--seed", "5")
        driver.start_streaming()
        for index in range(6):
            driver.send_twist(index, 0.1, 0.5 * index - 1.0)
        driver.run(3000)
        runs.append((driver.arrivals, driver.swarm.world.poses.tolist()))
    assert runs[0] == runs[1]


def test_a_server_that_does_not_read_stalls_the_whole_robot_and_its_watchdogs():
    driver = DriverSide("--perfect")
    driver.start_streaming()
    driver.drive(0, 0.1, 0.0, 1500)
    robot = driver.swarm.robots[0]
    robot.block_writing(driver.swarm.now_ms)
    driver.swarm.reschedule(0)
    since_ms = driver.swarm.now_ms
    driver.run(4900)
    assert not driver.list_frames(0, ids.ID_ODOM, since_ms + 1)
    assert driver.measure_speed(0) > 0.05
    driver.run(4000)
    assert driver.measure_speed(0) < 0.002
    assert driver.list_frames(0, ids.ID_ODOM, since_ms + 5000)


def test_a_frozen_robot_follows_its_last_command_again_afterwards():
    driver = DriverSide("--perfect")
    driver.start_streaming()
    driver.send_twist(0, 0.1, 0.0, ids.ID_POSITION_CMD_VEL)
    driver.run(150)
    slow_m_s = driver.measure_speed(0)
    driver.swarm.robots[0].freeze(driver.swarm.now_ms, 500)
    driver.swarm.reschedule(0)
    driver.run(1500)
    assert slow_m_s < 0.09 < driver.measure_speed(0)


def test_the_yaw_of_a_robot_with_an_imu_comes_from_it_and_a_set_heading_is_lost():
    driver = DriverSide("--imu-hat", "--perfect")
    driver.start_streaming()
    driver.drive(0, 0.0, 1.0, 2000, ids.ID_POSITION_CMD_VEL)
    driver.send_twist(0, 0.0, 0.0, ids.ID_POSITION_CMD_VEL)
    driver.send(0, ids.ID_SET_ODOM, struct.pack("<3d", 0.0, 0.0, -2.0))
    driver.run(1000)
    _, _, _, turn_w = read_odom(driver.list_frames(0, ids.ID_ODOM)[-1].payload)[2]
    assert 2.0 * math.acos(turn_w) == pytest.approx(driver.true_pose(0)[2], abs=0.01)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 124), st.binary(max_size=80)), max_size=8), st.binary(max_size=60))
def test_a_robot_survives_whatever_a_server_sends(sent, noise):
    driver = DriverSide()
    driver.start_streaming()
    driver.send_bytes(0, noise)
    for topic_id, payload in sent:
        driver.send(0, topic_id, payload)
    driver.run(400)
    driver.send_bytes(0, noise)
    driver.send(0, frames.ID_PUBLISHER)
    driver.run(400)
    if driver.swarm.robots[0].crash_reason is None:
        assert driver.list_frames(0, frames.ID_PUBLISHER)
    else:
        assert any(12 <= topic_id <= 99 or topic_id in (2, 3, 4, 5, 7, 8, 9, 1) for topic_id, _ in sent)


def test_what_the_imu_says_is_up_to_a_quarter_of_a_second_old():
    hat = ImuHat(0.0)
    ages_s = [
        now_ms / 1000.0 - hat.read(now_ms, now_ms / 1000.0, 1.0).heading_rad for now_ms in range(0, 3000, 34)
    ]
    assert 0.15 < max(ages_s) <= 0.25
    assert min(ages_s) == pytest.approx(0.0, abs=0.035)


def test_a_robots_odom_frame_stays_over_a_restart_follows_set_odom_and_is_carried_with_it():
    driver = DriverSide("--perfect", "--firmware-odometry", "exact")
    driver.start_streaming()
    robot = driver.swarm.robots[0]
    start = driver.true_pose(0)
    driver.drive(0, 0.1, 0.5, 3000, ids.ID_POSITION_CMD_VEL)
    driver.send_twist(0, 0.0, 0.0, ids.ID_POSITION_CMD_VEL)
    driver.run(1000)
    assert compose(robot.body.odom_origin, robot.sensing.odometry.pose) == pytest.approx(
        driver.true_pose(0), abs=0.02
    )
    robot.switch_on(driver.swarm.now_ms)
    assert robot.body.odom_origin == pytest.approx(start)
    driver.swarm.reschedule(0)
    driver.start_streaming()
    driver.send(0, ids.ID_SET_ODOM, struct.pack("<3d", 0.5, 0.0, 1.0))
    driver.run(200)
    assert compose(robot.body.odom_origin, (0.5, 0.0, 1.0)) == pytest.approx(driver.true_pose(0))
    driver.swarm.reset()
    assert driver.true_pose(0) == pytest.approx(start)
    assert compose(robot.body.odom_origin, (0.5, 0.0, 1.0)) == pytest.approx(driver.true_pose(0))
