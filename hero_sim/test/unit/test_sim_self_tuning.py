import math
import struct

import pytest
from driver_side import RECEIVED, SENT, DriverSide

from hero_driver.rosserial import packets
from hero_sim.robot_constants import RECEIVE_WINDOW_LENGTH

VELOCITY, POSITION = (
    (RECEIVED[kind + "cmd_vel"], RECEIVED[kind + "pid_calibration"], SENT[kind + "pid_calibration"])
    for kind in ("velocity_controller/", "position_controller/")
)
ZERO = bytes(48)
NEUTRAL_PULSES = packets.encode_packet(RECEIVED["cmd_motor"], struct.pack("<2h", 1500, 1500))
DARK = packets.encode_packet(RECEIVED["led"], bytes(16))

both_controllers = pytest.mark.parametrize("controller", [VELOCITY, POSITION], ids=["velocity", "position"])


def start(*arguments):
    driver = DriverSide("--perfect", *arguments)
    driver.start_streaming()
    return driver


def tune(driver, controller, ms=1000):
    driver.send(0, controller[1])
    driver.run(ms)
    assert is_tuning(driver, controller)
    return driver


def is_tuning(driver, controller):
    motors = driver.swarm.robots[0].motors
    return (motors.velocity if controller is VELOCITY else motors.position).tuning


def end_with(controllers, filler, count):
    """Return what is sent at once: packets that hold the robot's loop, and the zeros behind them."""
    zeros = [packets.encode_packet(controller[0], ZERO) for controller in controllers]
    return filler * count + b"".join(zeros)


def count_ended(controller, data, attempts):
    """Return how often data ended a tuning, sent at another point of the robot's cycle each time."""
    driver = start()
    ended = 0
    for attempt in range(attempts):
        if not is_tuning(driver, controller):
            tune(driver, controller, 200)
        driver.run(131 * attempt % 2000)
        driver.send_bytes(0, data)
        driver.run(200)
        ended += not is_tuning(driver, controller)
    return ended


def list_tuning_lines(driver, since_ms):
    return [text for at_ms, text in driver.list_logs(0) if "Tunning" in text and at_ms > since_ms]


@both_controllers
def test_self_tuning_answers_without_success_and_floods_the_log(controller):
    driver = tune(start(), controller, 2000)
    (answer,) = driver.list_packets(0, controller[2])
    assert answer.payload == b"\x00\x0f\x00\x00\x00PID Autotuning!"
    assert 45 <= len(list_tuning_lines(driver, driver.swarm.now_ms - 1000)) <= 48


def test_self_tuning_of_the_velocity_controller_spins_the_robot():
    driver = tune(start(), VELOCITY, 2000)
    before_rad = driver.true_pose(0)[2]
    driver.run(1000)
    assert abs(driver.true_pose(0)[2] - before_rad) == pytest.approx(4.0, abs=1.0)


def test_self_tuning_of_the_position_controller_rocks_to_and_fro():
    driver = tune(start(), POSITION, 1000)
    places_m = []
    for _ in range(600):
        driver.run(10)
        places_m.append(driver.true_pose(0)[:2])
    assert sum(map(math.dist, places_m, places_m[1:])) == pytest.approx(0.46, rel=0.05)
    assert max(math.dist(place_m, places_m[0]) for place_m in places_m) < 0.03


@both_controllers
@pytest.mark.parametrize("every_ms", [2, 100, 125])
def test_zeros_at_any_rate_do_not_end_self_tuning(controller, every_ms):
    driver = tune(start(), controller)
    for _ in range(3000 // every_ms):
        driver.send(0, controller[0], ZERO)
        driver.run(every_ms)
    assert is_tuning(driver, controller)
    assert not [text for _, text in driver.list_logs(0) if "Reseting" in text]


@both_controllers
def test_motion_pulses_and_a_lost_connection_do_not_end_self_tuning(controller):
    driver = tune(start(), controller)
    driver.send_twist(0, 0.1, 0.0, controller[0])
    driver.run(60)
    driver.send(0, controller[0], ZERO)
    driver.send_bytes(0, NEUTRAL_PULSES)
    driver.run(100)
    driver.swarm.robots[0].connection_lost()
    driver.run(1000)
    assert is_tuning(driver, controller)
    assert len(list_tuning_lines(driver, driver.swarm.now_ms - 500)) > 20


@pytest.mark.slow
@both_controllers
@pytest.mark.parametrize(
    "filler, count, length",
    [(NEUTRAL_PULSES, 110, 1376), (DARK, 55, 1376)],
    ids=["110 cmd_motor", "55 led"],
)
def test_a_zero_behind_50_ms_of_packets_in_one_send_ends_it(controller, filler, count, length):
    data = end_with([controller], filler, count)
    assert len(data) == length
    assert count_ended(controller, data, 17) == 17


@pytest.mark.slow
@both_controllers
def test_a_zero_behind_30_ms_of_packets_ends_self_tuning_rarely(controller):
    assert 0 < count_ended(controller, end_with([controller], NEUTRAL_PULSES, 60), 60) <= 10


@pytest.mark.slow
@both_controllers
def test_wheels_rest_and_a_zero_is_logged_once_tuning_was_ended(controller):
    driver = tune(start(), controller)
    driver.send_bytes(0, end_with([controller], NEUTRAL_PULSES, 110))
    since_ms = driver.swarm.now_ms
    driver.run(700)
    assert driver.measure_speed(0) < 0.001
    assert [text for at_ms, text in driver.list_logs(0) if at_ms > since_ms and "Reseting" in text] == [
        "\x1b[93m[/hero_0] Reseting PID...\x1b[0m"
    ]
    driver.run(2000)
    assert not list_tuning_lines(driver, since_ms + 200)


@both_controllers
def test_the_packets_in_several_sends_do_not_end_self_tuning(controller):
    driver = tune(start(), controller)
    for _ in range(10):
        driver.send_bytes(0, NEUTRAL_PULSES * 11)
        driver.run(60)
    driver.send(0, controller[0], ZERO)
    driver.run(200)
    assert is_tuning(driver, controller)


@pytest.mark.slow
@both_controllers
def test_a_burst_beyond_the_receive_window_ends_no_tuning(controller):
    driver = tune(start(), controller)
    data = end_with([controller], NEUTRAL_PULSES, 178)
    assert len(data) > RECEIVE_WINDOW_LENGTH
    driver.send_bytes(0, data)
    driver.run(500)
    assert is_tuning(driver, controller)


@pytest.mark.slow
@pytest.mark.parametrize("other, controller", [(POSITION, VELOCITY), (VELOCITY, POSITION)])
def test_a_zero_ends_the_tuning_of_its_own_controller_only(other, controller):
    driver = tune(tune(start(), VELOCITY), POSITION)
    driver.send_bytes(0, end_with([controller], NEUTRAL_PULSES, 110))
    driver.run(300)
    assert (is_tuning(driver, controller), is_tuning(driver, other)) == (False, True)


@pytest.mark.slow
def test_both_zeros_behind_the_packets_end_the_tuning_of_both():
    driver = tune(tune(start(), VELOCITY), POSITION)
    driver.send_bytes(0, end_with([VELOCITY, POSITION], NEUTRAL_PULSES, 110))
    driver.run(700)
    assert driver.measure_speed(0) < 0.001


@pytest.mark.slow
@pytest.mark.parametrize(
    "controller, least_s, most_s", [(VELOCITY, 41, 65), (POSITION, 11, 49)], ids=["velocity", "position"]
)
def test_self_tuning_fails_by_itself_after_the_measured_times(controller, least_s, most_s):
    lasted_s = []
    for seed in range(2):
        driver = tune(start("--seed", str(seed)), controller)
        since_ms = driver.swarm.now_ms - 1000
        while is_tuning(driver, controller):
            driver.run(50)
        lasted_s.append((driver.swarm.now_ms - since_ms) / 1000.0)
        driver.run(4500)
        logs = [text for _, text in driver.list_logs(0)]
        assert sum("Motor Tuning Failure!" in text for text in logs) == 2
        assert sum("Motor Best PID params" in text for text in logs) == 2
        assert driver.measure_speed(0) < 0.001
    assert least_s <= min(lasted_s) and max(lasted_s) <= most_s + 0.1
    assert lasted_s[0] != lasted_s[1]


@pytest.mark.slow
def test_after_a_failed_tuning_the_last_velocity_drives_for_a_second():
    driver = start()
    driver.drive(0, 0.1, 0.0, 500)
    driver.send(0, VELOCITY[0], ZERO)
    driver.run(500)
    tune(driver, VELOCITY)
    while is_tuning(driver, VELOCITY):
        driver.run(20)
    driver.run(900)
    assert driver.swarm.world.speeds_m_s[0] == pytest.approx([0.1, 0.1], abs=0.05)


@pytest.mark.slow
def test_a_robot_that_was_frozen_while_tuning_drops_the_zeros_that_waited():
    driver = tune(start(), VELOCITY)
    robot = driver.swarm.robots[0]
    for frozen_ms in range(200, 260, 3):
        robot.freeze(driver.swarm.now_ms, frozen_ms)
        driver.swarm.reschedule(0)
        driver.send(0, VELOCITY[0], ZERO)
        driver.run(frozen_ms + 200)
        assert is_tuning(driver, VELOCITY)
