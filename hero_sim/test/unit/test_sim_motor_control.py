import struct

import numpy as np
import pytest
from driver_side import POSITION, RECEIVED, SENT, VELOCITY, DriverSide, read_encoder
from hypothesis import given, settings
from hypothesis import strategies as st

from hero_driver.rosserial import packets
from hero_node.robot_constants import TICK_M
from hero_sim.robot.motor_pid import Gains, MotorPid
from hero_test.nonempty import nonempty


def start(*arguments):
    driver = DriverSide("--perfect", *arguments)
    driver.start_streaming()
    return driver


def push(driver, left_us, right_us):
    """Return the wheels' speeds that these pulses lead to."""
    driver.send(0, RECEIVED["cmd_motor"], struct.pack("<2h", left_us, right_us))
    driver.run(600)
    return driver.swarm.world.speeds_m_s[0].tolist()


def set_velocity_gains(driver, *gains):
    driver.send(0, RECEIVED["velocity_controller/pid_parameters"], struct.pack("<6f", *gains, *gains))
    driver.run(200)


def measure_mean_speed(driver, seconds=2):
    before = driver.swarm.world.travels_m[0].copy()
    driver.drive(0, 0.1, 0.0, seconds * 1000)
    return ((driver.swarm.world.travels_m[0] - before) / seconds).tolist()


# The ticks of both wheels that a complete stock firmware, built for a PC, counted from rest under
# velocity commands of 0.1 m/s, ten a second; the first column is the time since the first tick.
STOCK_STEP = (
    (0.10, 5, 5),
    (0.31, 22, 22),
    (0.51, 38, 39),
    (0.71, 58, 61),
    (0.92, 82, 85),
    (1.50, 160, 168),
    (2.03, 234, 241),
    (2.51, 319, 322),
    (2.95, 399, 403),
)


def count_ticks_from_rest(driver):
    """Return the mean ticks of the left wheel at the times of STOCK_STEP."""
    counts = {}
    driver.send_twist(0, 0.1, 0.0)
    first_ms = None
    robot, start_m = driver.swarm.robots[0], driver.swarm.world.travels_m[0, 0]
    for ms in range(3100):
        if ms % 100 == 99:
            driver.send_twist(0, 0.1, 0.0)
        driver.run(1)
        ticks = (robot.body.read_wheels(robot.to_millis(driver.swarm.now_ms))[0] - start_m) / TICK_M
        if first_ms is None and ticks >= 1.0:
            first_ms = driver.swarm.now_ms
        if first_ms is not None:
            counts[driver.swarm.now_ms - first_ms] = ticks
    return [counts[round(at_s * 1000)] for at_s, _, _ in STOCK_STEP]


@pytest.mark.slow
def test_the_pids_drive_a_motor_like_the_measured_one_as_the_firmware_did():
    counts = []
    for delay_ms in range(0, 1000, 200):  # the robot's cycles meet differently each time
        driver = start("--error", "left_gain=0.45,right_gain=0.45,lag_s=0.25")
        driver.run(delay_ms)
        counts.append(count_ticks_from_rest(driver))
    for ticks, (_, left, right) in nonempty(zip(np.mean(counts, axis=0), STOCK_STEP)):
        assert ticks == pytest.approx((left + right) / 2.0, abs=3.0, rel=0.05)


def test_the_servos_are_mirrored_below_the_center_is_forward_on_the_left():
    assert push(start(), 1400, 1600) == pytest.approx([70 * 0.25 / 220] * 2, rel=0.01)


@pytest.mark.parametrize("beyond_us, stands", [(29, True), (-30, True), (31, False), (-32, False)])
def test_a_wheel_rests_within_its_dead_zone_around_its_center(beyond_us, stands):
    driver = start("--error", "robot=0,left_center_us=1480,right_center_us=1530")
    speeds_m_s = push(driver, 1480 + beyond_us, 1530 + beyond_us)
    assert [speed_m_s == 0.0 for speed_m_s in speeds_m_s] == [stands, stands]


@pytest.mark.slow
def test_a_robot_without_calibrated_centers_creeps_until_they_are_set():
    driver = start("--motors", "factory", "--error", "left_center_us=1440,right_center_us=1540")
    world = driver.swarm.world
    set_velocity_gains(driver, 1e-3, 0.0, 0.0)
    driver.drive(0, 0.1, 0.0, 1000)
    # All that the controller gives is what it takes for the middle: 1500 is beyond both dead zones, backward.
    assert world.speeds_m_s[0] == pytest.approx([-30 * 0.25 / 220, -10 * 0.25 / 220], rel=0.05)
    driver.send(0, RECEIVED["motors_parameters"], struct.pack("<2h", 1440, 1540))
    driver.run(100)
    driver.drive(0, 0.1, 0.0, 1000)
    assert world.speeds_m_s[0] == pytest.approx([0.0, 0.0], abs=1e-3)


def test_each_wheel_has_gains_of_its_own():
    driver = start()
    driver.send(0, RECEIVED["velocity_controller/pid_parameters"], struct.pack("<6f", 1200, 2300, 0.1, 1e-3, 0, 0))
    driver.run(200)
    left_m_s, right_m_s = measure_mean_speed(driver)
    assert left_m_s > 0.06
    assert right_m_s == 0.0


def test_a_stop_and_a_reversal_reset_the_integral():
    driver = start()
    driver.drive(0, 0.1, 0.0, 3000)
    (pid, _) = driver.swarm.robots[0].motors.velocity.pids
    assert pid.output_us > 80
    driver.send_twist(0, -0.1, 0.0)
    driver.run(60)
    assert pid.output_us < 0
    driver.send_twist(0, 0.0, 0.0)
    driver.run(60)
    assert pid.output_us == 0


def test_a_position_command_drives_as_far_as_its_speed_in_one_second():
    driver = start()
    driver.send_twist(0, 0.1, 0.0, POSITION)
    distances_m = []
    for _ in range(290):
        driver.run(10)
        distances_m.append(driver.swarm.world.travels_m[0, 0])
    assert 0.1 < max(distances_m) < 0.15
    assert np.mean(distances_m[-50:]) == pytest.approx(0.1, abs=0.02)


@pytest.mark.slow
def test_the_gains_of_the_position_controller_matter():
    distances_m = []
    for gains in ((5.0, 9.0, 0.1), (1.0, 0.0, 0.0)):
        driver = start()
        driver.send(0, RECEIVED["position_controller/pid_parameters"], struct.pack("<6f", *gains, *gains))
        driver.run(200)
        driver.send_twist(0, 0.1, 0.0, POSITION)
        driver.run(2900)
        distances_m.append(driver.swarm.world.travels_m[0, 0])
    # With 1 us per tick the wheel stops where the output meets the dead zone of 30 us.
    assert distances_m[1] == pytest.approx(0.1 - 30 * TICK_M, abs=0.004)
    assert abs(distances_m[0] - 0.1) < abs(distances_m[1] - 0.1) + 0.03


def test_a_zero_for_one_controller_leaves_the_other_driving():
    for driving, stopped in (
        (POSITION, VELOCITY),
        (VELOCITY, POSITION),
    ):
        driver = start()
        driver.send_twist(0, 0.1, 0.0, driving)
        driver.run(60)
        driver.send_twist(0, 0.0, 0.0, stopped)
        driver.run(700)
        assert driver.swarm.robots[0].motors.motors.attached
        assert driver.measure_speed(0) > 0.02


def test_both_zeros_in_one_send_stop_whatever_was_commanded():
    driver = start()
    driver.send_twist(0, 0.1, 0.0, POSITION)
    driver.send_twist(0, 0.1, 1.0)
    driver.send(0, RECEIVED["cmd_motor"], struct.pack("<2h", 1300, 1700))
    driver.run(110)
    assert driver.measure_speed(0) > 0.02
    driver.send_twist(0, 0.0, 0.0)
    driver.send_twist(0, 0.0, 0.0, POSITION)
    driver.run(60)
    assert not driver.swarm.robots[0].motors.motors.attached
    driver.run(600)
    assert driver.measure_speed(0) < 0.001


def test_both_controllers_at_once_write_pulses_in_turn():
    driver = start()
    driver.send_twist(0, 0.1, 0.0, POSITION)
    driver.run(60)
    driver.send_twist(0, -0.1, 0.0)
    driver.run(200)
    signs = set()
    for _ in range(100):
        driver.run(1)
        signs.add(np.sign(driver.swarm.world.commands_m_s[0, 0]))
    assert {-1.0, 1.0} <= signs


def test_neutral_pulses_let_a_wheel_with_another_center_creep_for_a_second():
    driver = start("--error", "left_center_us=1540")
    assert push(driver, 1500, 1500) == pytest.approx([10 * 0.25 / 220, 0.0], rel=0.05)
    driver.run(1000)
    assert driver.measure_speed(0) < 0.001


def test_until_3_s_of_uptime_the_position_controller_runs():
    driver = DriverSide("--perfect", "--motors", "factory", "--error", "left_center_us=1540")
    driver.run(1900)
    driver.send(0, packets.ID_PUBLISHER)
    attached_ms = []
    robot = driver.swarm.robots[0]
    for _ in range(3000):
        driver.run(1)
        if robot.motors.motors.attached:
            attached_ms.append(robot.to_millis(driver.swarm.now_ms))
    assert attached_ms[0] < 2200
    assert attached_ms[-1] == pytest.approx(4000, abs=25)
    assert 1 <= driver.swarm.world.travels_m[0, 0] / TICK_M < 10


def test_the_encoders_measure_the_wheels_not_the_commands():
    driver = start("--error", "right_gain=0.5")
    driver.send(0, RECEIVED["cmd_motor"], struct.pack("<2h", 1400, 1600))
    driver.run(900)
    left, right = read_encoder(driver.list_packets(0, SENT["encoder"])[-1].payload)[:2]
    assert right / left == pytest.approx(0.5, abs=0.05)


twists = st.tuples(
    st.sampled_from((VELOCITY, POSITION)),
    st.tuples(st.floats(-1.0, 1.0), st.floats(-20.0, 20.0)).map(
        lambda pair: struct.pack("<6d", pair[0], 0, 0, 0, 0, pair[1])
    ),
)
pulses = st.tuples(
    st.just(RECEIVED["cmd_motor"]),
    st.tuples(st.integers(-(2**15), 2**15 - 1), st.integers(-(2**15), 2**15 - 1)).map(
        lambda pair: struct.pack("<2h", *pair)
    ),
)
gains = st.tuples(
    st.sampled_from((RECEIVED["velocity_controller/pid_parameters"], RECEIVED["position_controller/pid_parameters"])),
    st.lists(st.floats(-1e9, 1e9, width=32), min_size=6, max_size=6).map(lambda six: struct.pack("<6f", *six)),
)
tunings = st.tuples(
    st.sampled_from([RECEIVED[kind + "_controller/pid_calibration"] for kind in ("velocity", "position")]), st.just(b"")
)


@settings(max_examples=8)
@given(
    seed=st.integers(0, 1000),
    sent=st.lists(st.tuples(st.integers(0, 4), st.one_of(twists, pulses, gains, tunings)), min_size=5, max_size=20),
)
def test_no_commands_drive_robots_into_walls_or_keep_them_from_stopping(seed, sent):
    driver = DriverSide("--count", "5", "--arena", "obstacles", "--seed", str(seed))
    driver.start_streaming()
    world = driver.swarm.world
    overlaps = []
    driver.swarm.after_step = lambda now_ms: overlaps.append([depth_m.max() for depth_m in world.measure_overlaps()])
    for robot, (topic_id, payload) in sent:
        driver.send(robot, topic_id, payload)
        driver.run(100)
    for robot in range(5):
        # Behind packets that hold its loop for 55 ms a robot accepts zeros, also while it tunes itself.
        neutral = packets.encode_packet(RECEIVED["cmd_motor"], struct.pack("<2h", 1500, 1500))
        driver.send_bytes(robot, neutral * 110)
        driver.send_twist(robot, 0.0, 0.0)
        driver.send_twist(robot, 0.0, 0.0, POSITION)
    driver.run(700)
    in_robots_m, in_walls_m = map(max, zip(*overlaps))
    assert in_robots_m < 5e-4 and in_walls_m < 1e-6
    assert abs(world.speeds_m_s).max() < 0.002


def test_a_pid_weighs_error_sum_and_change_of_what_it_measures():
    pid = MotorPid(Gains(100.0, 200.0, 0.1), 250.0)
    pid.run(0, 0.5, 0.1)
    assert pid.output_us == int(100.0 * 0.4 + 200.0 * 0.05 * 0.4 - 0.1 / 0.05 * 0.1) == 43
    pid.run(49, 9.0, 9.0)
    assert pid.output_us == 43, "only every 50 ms"
    pid.run(50, 0.5, 0.3)
    assert pid.output_us == int(100.0 * 0.2 + 4.0 + 2.0 - 0.1 / 0.05 * 0.2) == 25
    pid.run(100, -0.5, 0.3)
    assert pid.output_us == int(-80.0 + 6.0 - 8.0) == -82
    pid.run(150, -0.4055, 0.3)
    assert pid.output_us == -79, "truncated, not rounded down"
    pid.reset()
    assert pid.output_us == 0
    pid.run(200, 0.1, 0.0)
    assert pid.output_us == 11


def test_the_sum_and_the_output_of_a_pid_stay_within_its_limit():
    for sign in (1.0, -1.0):
        pid = MotorPid(Gains(10.0, 200.0, 0.0), 250.0)
        for now_ms in range(0, 5000, 50):
            pid.run(now_ms, sign * 1.0, 0.0)
        assert pid.output_us == sign * 250
        pid.run(5000, 0.0, sign * 0.1)
        assert pid.output_us == sign * 248, "no more has been summed up than the limit"


def test_gains_with_a_negative_one_are_left_out():
    pid = MotorPid(Gains(1.0, 2.0, 3.0), 250.0)
    pid.set_gains(Gains(4.0, -0.1, 5.0))
    assert pid.gains == (1.0, 2.0, 3.0)
    pid.set_gains(Gains(0.0, 0.0, 0.0))
    assert pid.gains == (0.0, 0.0, 0.0)
