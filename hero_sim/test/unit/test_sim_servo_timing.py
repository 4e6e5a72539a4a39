"""Robots with the servo timing of either ESP8266 core, and with servo centers that are off."""

import argparse
import struct

import pytest
from driver_side import RECEIVED, SENT, DriverSide
from hypothesis import given, settings
from hypothesis import strategies as st

from hero_driver.rosserial import packets
from hero_sim.population import draw_servo_timing
from hero_sim.robot.servo_pins import CORE_2, CORE_3, PERIOD_US, ServoPins

ZERO = bytes(48)
NEUTRAL_PULSES = packets.encode_packet(RECEIVED["cmd_motor"], struct.pack("<2h", 1500, 1500))
DARK = packets.encode_packet(RECEIVED["led"], bytes(16))
TWISTS = (RECEIVED["velocity_controller/cmd_vel"], RECEIVED["position_controller/cmd_vel"])
ZEROS = b"".join(packets.encode_packet(topic, ZERO) for topic in TWISTS)
TUNINGS = (RECEIVED["velocity_controller/pid_calibration"], RECEIVED["position_controller/pid_calibration"])
DEAD_ZONE_US = 15

both_cores = pytest.mark.parametrize("timing", [CORE_2, CORE_3])
robots = st.fixed_dictionaries(
    {
        "seed": st.integers(0, 2**32 - 1),
        "centers_us": st.tuples(st.integers(1450, 1550), st.integers(1450, 1550)),
        "timing": st.sampled_from((CORE_2, CORE_3)),
        "delay_ms": st.integers(0, 300),  # the robot's cycles meet differently each time
    }
)


def start(timing, *arguments):
    driver = DriverSide("--servo-timing", timing, *arguments)
    driver.start_streaming()
    return driver


def start_drawn(robot, motors="calibrated"):
    """Return the conversation with a robot of the spread; its flash has its centers, or 1500 (factory)."""
    errors = "left_center_us=%d,right_center_us=%d,dead_zone_us=%d" % (*robot["centers_us"], DEAD_ZONE_US)
    driver = start(robot["timing"], "--motors", motors, "--seed", str(robot["seed"]), "--error", errors)
    driver.run(robot["delay_ms"])
    return driver


def measure_gap(driver, run):
    """Return the longest time (ms) without a reading of the wheels while run() takes its time."""
    since_ms = driver.swarm.now_ms
    run()
    arrivals = driver.list_packets(0, SENT["encoder"], since_ms - 100)
    times_ms = [arrival.at_ms for arrival in arrivals] + [driver.swarm.now_ms]
    return max(later - earlier for earlier, later in zip(times_ms, times_ms[1:]))


def send_and_wait(driver, data, ms):
    driver.send_bytes(0, data)
    driver.run(ms)


def is_tuning(driver):
    motors = driver.swarm.robots[0].motors
    return motors.velocity.tuning or motors.position.tuning


def test_core_2_never_waits_for_a_pulse():
    pins = ServoPins(CORE_2)
    assert [pins.write(0) for _ in range(10)] == [0] * 10
    assert pins.detach() == 0


def test_core_3_takes_one_change_per_pin_and_period():
    pins = ServoPins(CORE_3)
    assert pins.write(0) == 0  # attached
    assert pins.write(1000) == PERIOD_US - 1000  # the left change waits in the mailbox, the right write for it
    now_us = PERIOD_US
    for _ in range(139):
        now_us += pins.write(now_us)
    assert now_us == 140 * PERIOD_US


def test_core_3_writes_without_waiting_once_the_mailbox_is_empty():
    pins = ServoPins(CORE_3)
    pins.write(0)
    pins.write(PERIOD_US - 1)
    # The right servo's change is taken 250 us after the left one's: nothing is in the left one's way.
    assert pins.write(PERIOD_US + 300) == 2 * PERIOD_US - (PERIOD_US + 300)


def test_core_3_waits_a_period_for_each_servo_that_is_detached():
    pins = ServoPins(CORE_3)
    assert pins.detach() == 0
    pins.write(0)
    pins.write(100)
    assert pins.detach() == 2 * PERIOD_US
    assert (pins.detach(), pins.write(200)) == (0, 0)


@pytest.mark.slow
@pytest.mark.parametrize("timing, least_ms, most_ms", [(CORE_2, 70, 150), (CORE_3, 2700, 2950)])
def test_140_servo_pulses_keep_a_robot_deaf_for_as_long_as_measured(timing, least_ms, most_ms):
    driver = start(timing)
    assert least_ms < measure_gap(driver, lambda: send_and_wait(driver, NEUTRAL_PULSES * 140, 4000)) < most_ms


@both_cores
def test_a_driven_robot_sends_its_readings_and_keeps_its_speed(timing):
    driver = start(timing, "--perfect")
    driver.drive(0, 0.1, 0.0, 2000)
    before_m = driver.swarm.world.travels_m[0, 0]
    assert measure_gap(driver, lambda: driver.drive(0, 0.1, 0.0, 3000)) < 80
    assert driver.swarm.world.travels_m[0, 0] - before_m == pytest.approx(0.3, rel=0.05)


@both_cores
def test_pulses_that_are_not_renewed_end_after_a_second(timing):
    driver = start(timing)
    send_and_wait(driver, packets.encode_packet(RECEIVED["cmd_motor"], struct.pack("<2h", 1400, 1600)), 900)
    assert driver.measure_speed(0) > 0.05
    driver.run(900)
    assert driver.measure_speed(0) < 0.001


@both_cores
def test_a_robot_that_tunes_both_controllers_still_reads(timing):
    driver = start(timing)
    for tuning in TUNINGS:
        driver.send(0, tuning)
        driver.run(300)
    send_and_wait(driver, DARK * 62 + ZEROS, 600)
    assert not is_tuning(driver)


@settings(max_examples=10)
@given(robot=robots, tuning=st.sampled_from(TUNINGS))
def test_62_led_packets_and_zeros_end_every_self_tuning_in_time(robot, tuning):
    driver = start_drawn(robot)
    driver.send(0, tuning)
    driver.run(1000 + robot["delay_ms"])
    assert is_tuning(driver)
    assert measure_gap(driver, lambda: send_and_wait(driver, DARK * 62 + ZEROS, 590)) < 250
    assert driver.measure_speed(0) < 0.005


@settings(max_examples=6)
@given(robot=robots, controller=st.sampled_from(list(zip(TUNINGS, TWISTS))))
def test_its_own_zeros_alone_end_no_self_tuning_with_either_core(robot, controller):
    driver = start_drawn(robot)
    driver.send(0, controller[0])
    driver.run(500)
    for _ in range(40):
        send_and_wait(driver, packets.encode_packet(controller[1], ZERO), 25)
    assert is_tuning(driver)


@settings(max_examples=10)
@given(robot=robots)
def test_a_zero_rests_wherever_the_centers_are_and_1500_us_do_not(robot):
    driver = start_drawn(robot, motors="factory")
    driver.drive(0, 0.1, 0.0, 1000)
    send_and_wait(driver, ZEROS, 500)
    assert driver.measure_speed(0) < 0.001
    send_and_wait(driver, NEUTRAL_PULSES, 500)
    is_off = any(abs(center_us - 1500) > DEAD_ZONE_US for center_us in robot["centers_us"])
    assert (driver.measure_speed(0) > 0.0005) == is_off
    send_and_wait(driver, ZEROS, 500)
    assert driver.measure_speed(0) < 0.001


@pytest.mark.slow
@settings(max_examples=4)
@given(robot=robots, tuning=st.sampled_from(TUNINGS))
def test_a_tuning_robot_without_time_answers_keeps_its_last_pulses(robot, tuning):
    driver = start_drawn(robot)
    driver.send(0, tuning)
    driver.answer_time = False
    driver.run(12000)
    assert not driver.swarm.robots[0].configured
    pulses_m_s = driver.swarm.world.commands_m_s[0].tolist()
    assert any(pulses_m_s)
    driver.run(10000)
    assert driver.swarm.world.commands_m_s[0].tolist() == pulses_m_s


@pytest.mark.slow
def test_drawn_timings_depend_on_seed_and_id_and_both_occur():
    def draw(robot_id, seed=0, timing="drawn"):
        return draw_servo_timing(argparse.Namespace(servo_timing=timing, seed=seed), robot_id)

    drawn = [draw(robot_id) for robot_id in range(100)]
    assert 30 < drawn.count(CORE_3) < 70
    assert drawn == [draw(robot_id) for robot_id in range(100)]
    assert drawn != [draw(robot_id, seed=1) for robot_id in range(100)]
    assert draw(1, timing=CORE_3) == CORE_3
