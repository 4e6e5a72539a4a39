import struct

import pytest
from driver_side import RECEIVED, SENT, SERVER_START_S, STOCK_SUBSCRIPTIONS, VELOCITY, DriverSide, read_odom
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hero_driver.rosserial import packets, payloads
from hero_sim.robot.clock import NEVER_MS
from hero_test.nonempty import nonempty


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
    assert {arrival.topic_id for arrival in driver.arrivals[0]} == {packets.ID_LOG}


def test_a_request_is_answered_by_a_time_request_and_all_declarations():
    driver = DriverSide()
    driver.run(2500)
    driver.send(0, packets.ID_PUBLISHER)
    driver.run(102)
    burst = [arrival for arrival in driver.arrivals[0] if arrival.topic_id < 7 or arrival.topic_id == packets.ID_TIME]
    assert [arrival.topic_id for arrival in burst[:25]] == [10, 0, 2, 0, 0, 0, 0] + [2] * 6 + STOCK_SUBSCRIPTIONS
    assert len({arrival.at_ms for arrival in burst[:25]}) == 1


def test_a_repeated_request_repeats_the_burst_one_per_spin():
    driver = DriverSide()
    driver.start_streaming()
    driver.arrivals[0].clear()
    driver.send_bytes(0, packets.encode_packet(0, b"") * 3)
    driver.run(300)
    times = [arrival.at_ms for arrival in driver.list_packets(0, 0)][::5]
    assert len(times) == 3
    assert [later - earlier for earlier, later in zip(times, times[1:])] == [51, 51]


def test_a_request_before_the_robot_advertised_gets_undeclared_data():
    driver = DriverSide()
    while not driver.connects[0]:
        driver.run(1)
    driver.send(0, packets.ID_PUBLISHER)
    driver.run(3000)
    assert len(driver.list_packets(0, packets.ID_TIME)) >= 1
    assert not driver.list_packets(0, packets.ID_PUBLISHER)
    assert driver.list_packets(0, SENT["odom"])
    driver.send(0, packets.ID_PUBLISHER)
    driver.run(200)
    assert len(driver.list_packets(0, packets.ID_PUBLISHER)) == 5


@pytest.mark.slow
def test_rates_are_the_stock_robots():
    driver = DriverSide()
    driver.start_streaming()
    driver.run(1000)
    since_ms = driver.swarm.now_ms
    driver.run(20000)
    rates = {
        topic_id: (len(got) - 1) / (got[-1].at_ms - got[0].at_ms) * 1000.0
        for topic_id, got in ((topic, driver.list_packets(0, topic, since_ms)) for topic in (7, 10, 125, 128, 129, 130))
    }
    assert rates[130] == pytest.approx(29.27, abs=0.05)
    assert rates[128] == pytest.approx(29.27, abs=0.05)
    assert rates[129] == pytest.approx(146.3, abs=0.5)
    assert rates[125] == pytest.approx(4.87, abs=0.02)
    assert rates[7] == pytest.approx(1.0, abs=0.01)
    assert rates[10] == pytest.approx(0.395, abs=0.01)
    assert not driver.list_packets(0, SENT["imu"])


@pytest.mark.slow
def test_the_imu_hat_is_declared_by_all_but_published_only_where_it_is():
    driver = DriverSide("--imu-hat")
    driver.start_streaming()
    driver.run(2000)
    imus = driver.list_packets(0, SENT["imu"])
    assert len(imus) == len(driver.list_packets(0, SENT["odom"]))
    assert len(imus[0].payload) + 8 == 335
    values = struct.unpack_from("<37d", imus[-1].payload, len(imus[-1].payload) - 37 * 8)
    assert values[3] == 0.99993896484375
    assert values[27] == pytest.approx(8.192)
    assert "IMU hat detected!" in driver.list_logs(0)[1][1]


def test_stamps_are_uptime_before_the_first_answer_and_server_time_after():
    driver = DriverSide()
    driver.start_streaming()
    odoms = driver.list_packets(0, SENT["odom"])
    stamps = [read_odom(arrival.payload)[0] for arrival in odoms]
    assert stamps[0][0] < 10
    assert 1 <= sum(stamp[0] < 10 for stamp in stamps) <= 3
    for arrival, (seconds, nanoseconds) in nonempty(list(zip(odoms, stamps))[3:]):
        expected_s = SERVER_START_S + arrival.at_ms / 1000.0
        assert seconds + nanoseconds * 1e-9 == pytest.approx(expected_s, abs=0.002)


def test_a_late_answer_puts_the_clock_ahead_by_its_lateness():
    driver = DriverSide(answer_time=False)
    driver.run(2500)
    driver.send(0, packets.ID_PUBLISHER)
    driver.run(400)
    # The answer holds the time at which it is made, 0.3 s and more after the robot asked.
    asked_ms = driver.list_packets(0, packets.ID_TIME)[0].at_ms
    made_ms = driver.swarm.now_ms
    driver.send(0, packets.ID_TIME, payloads.encode_time(driver.server_time()))
    driver.run(200)
    arrival = driver.list_packets(0, SENT["odom"])[-1]
    seconds, nanoseconds = read_odom(arrival.payload)[0]
    ahead_s = seconds + nanoseconds * 1e-9 - (SERVER_START_S + arrival.at_ms / 1000.0)
    assert ahead_s == pytest.approx((made_ms - asked_ms) / 1000.0, abs=0.002)


@pytest.mark.slow
def test_without_time_answers_a_robot_streams_for_eleven_seconds():
    driver = DriverSide(answer_time=False)
    driver.run(2500)
    driver.send(0, packets.ID_PUBLISHER)
    driver.run(20000)
    asked = [arrival.at_ms for arrival in driver.list_packets(0, packets.ID_TIME)]
    assert len(asked) == 5
    assert all(2501 <= later - earlier <= 2551 for earlier, later in zip(asked, asked[1:]))
    last_ms = driver.list_packets(0, SENT["odom"])[-1].at_ms
    assert last_ms - asked[0] == pytest.approx(11000, abs=60)
    driver.send(0, packets.ID_PUBLISHER)
    driver.run(200)
    assert driver.list_packets(0, SENT["odom"], last_ms + 1)


def test_a_robot_without_connection_retries_each_spin_and_streams_at_once():
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
    assert driver.list_packets(0, SENT["odom"], back_ms)[0].at_ms - back_ms <= 35
    assert not driver.list_packets(0, packets.ID_PUBLISHER, back_ms)


def test_a_zero_that_came_with_the_end_of_a_connection_is_lost():
    driver = DriverSide()
    driver.start_streaming()
    driver.connect = False
    driver.drive(0, 0.1, 0.0, 500)
    driver.send_twist(0, 0.0, 0.0)
    driver.swarm.robots[0].connection_lost()
    since_ms = driver.swarm.now_ms
    driver.run(500)
    assert [at_ms for at_ms in driver.connects[0] if at_ms > since_ms]
    assert driver.measure_speed(0) > 0.03


packet_bytes = st.sampled_from(
    [
        packets.encode_packet(packets.ID_PUBLISHER, b""),
        packets.encode_packet(RECEIVED["led"], bytes(16)) * 5,
        packets.encode_packet(RECEIVED["cmd_motor"], bytes(4)) * 5,
        packets.encode_packet(VELOCITY, bytes(48)),
        packets.encode_packet(RECEIVED["velocity_controller/pid_calibration"], b""),
    ]
)
happenings = st.sampled_from(["lost", "made", "failed", "frozen", "blocked", "unblocked", "restarted"])


@given(script=st.lists(st.tuples(st.integers(0, 120), st.one_of(packet_bytes, happenings)), max_size=25))
@example(script=[(0, "restarted"), (0, "frozen"), (70, "unblocked")] * 5)
@settings(max_examples=20)
def test_whatever_happens_to_its_link_a_robot_runs_again_but_not_at_once(script):
    driver = DriverSide()
    driver.start_streaming()
    robot = driver.swarm.robots[0]
    now_ms = driver.swarm.now_ms
    robot.due_ms = now_ms
    for after_ms, what in script:
        until_ms = now_ms + after_ms
        while robot.due_ms <= until_ms:
            now_ms = max(now_ms, robot.due_ms)
            robot.run(now_ms)
            assert robot.due_ms > now_ms
        now_ms = until_ms
        if isinstance(what, bytes):
            robot.receive_bytes(now_ms, what)
        elif what == "lost":
            robot.connection_lost()
        elif what == "made":
            robot.connection_made(now_ms)
        elif what == "failed":
            robot.connection_failed(now_ms)
        elif what == "frozen":
            robot.freeze(now_ms, 70)
        elif what == "blocked":
            robot.block_writing(now_ms)
        elif what == "unblocked":
            robot.unblock_writing(now_ms)
        else:
            robot.switch_on(now_ms)


@pytest.mark.slow
def test_robots_started_together_do_the_same_for_the_same_seed():
    runs = []
    for _ in range(2):
        driver = DriverSide("--count", "6", "--seed", "5")
        driver.start_streaming()
        for index in range(6):
            driver.send_twist(index, 0.1, 0.5 * index - 1.0)
        driver.run(3000)
        runs.append((driver.arrivals, driver.swarm.world.poses.tolist()))
    assert runs[0] == runs[1]


def test_the_rest_of_a_packet_does_not_outlive_its_connection():
    driver = DriverSide()
    driver.start_streaming()
    firmware, now_ms = driver.swarm.robots[0], driver.swarm.now_ms
    firmware.receive_bytes(now_ms, b"\xff\xfe\x30")
    assert firmware.received_length >= 3
    firmware.connection_lost()
    firmware.connection_made(now_ms)
    assert firmware.received_length == 0


def test_a_reboot_in_the_middle_of_a_spin_is_as_any_other():
    fresh, driver = DriverSide(connect=False), DriverSide()
    fresh.run(6000)
    driver.start_streaming()
    (robot,) = driver.swarm.robots
    driver.send_bytes(0, packets.encode_packet(RECEIVED["led"], bytes(16)) * 80)
    driver.run(60)  # each takes 1 ms of the spin
    robot.connection_lost()
    robot.switch_off()
    assert robot.due_ms == NEVER_MS and not robot.is_on
    driver.connect, booted_ms = False, driver.swarm.now_ms + 10
    robot.switch_on(booted_ms)
    driver.swarm.reschedule(0)
    driver.run(5500)
    after_ms = [at_ms - booted_ms for at_ms in driver.connects[0] if at_ms > booted_ms]
    first_ms = fresh.swarm.robots[0].body.booted_ms
    assert len(after_ms) > 30 and after_ms == [at_ms - first_ms for at_ms in fresh.connects[0]][: len(after_ms)]


def test_a_robot_that_cannot_write_blocks_for_5_s_unless_it_can_again():
    for freed_after_ms, silent_ms in ((None, 5000), (1200, 1200)):
        driver = DriverSide()
        driver.start_streaming()
        firmware, now_ms = driver.swarm.robots[0], driver.swarm.now_ms
        firmware.block_writing(now_ms)
        firmware.block_writing(now_ms + 100)  # it blocks already
        assert firmware.due_ms == now_ms + 5000
        if freed_after_ms:
            firmware.unblock_writing(now_ms + freed_after_ms)
        assert abs(firmware.due_ms - now_ms - silent_ms) <= 60
