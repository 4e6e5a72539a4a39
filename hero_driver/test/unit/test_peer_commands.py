"""Commands on their way out, in the driver's own time: far enough apart for a robot that reads every 51 ms."""

import itertools

import pytest
from commanded_robot import LIGHT, MOTORS, POSITION, VELOCITY, Clock, CommandedRobot
from hypothesis import given
from hypothesis import strategies as st

from hero_driver.commands.velocity_shaper import STOPPED_MOTORS
from hero_driver.peer import SILENCE_LIMIT_S

GATE_S = 0.050
"""The firmware drops a velocity that it reads within this time after the last one that it took."""

LIGHT_PAYLOAD = b"\x01" * 16

phases = st.floats(0.0, 0.051)
networks = st.floats(0.0, 0.2)
scripts = st.lists(st.tuples(st.floats(0.0, 0.15), st.sampled_from([0.0, 0.05, 0.1])), min_size=1, max_size=30)


def list_gaps_s(times_s):
    return [later - earlier for earlier, later in zip(times_s, times_s[1:])]


@given(script=scripts, phase_s=phases, network_s=networks)
def test_a_robot_does_what_was_commanded_last_whenever_it_reads(script, phase_s, network_s):
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock, network_s, phase_s)
        for pause_s, speed_m_s in script:
            clock.run(pause_s)
            robot.drive(speed_m_s)
        clock.run(5.0)
    assert robot.list_speeds()[-1][1] == script[-1][1]
    assert robot.motors.is_turning == (script[-1][1] != 0.0)


@given(rate_hz=st.floats(5.0, 1000.0), phase_s=phases, network_s=networks)
def test_no_two_commands_are_written_or_read_within_the_firmwares_gate(rate_hz, phase_s, network_s):
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock, network_s, phase_s)
        for number in range(int(2.0 * rate_hz)):
            robot.drive(0.01 + 0.0001 * number)
            clock.run(1.0 / rate_hz)
        robot.drive(0.0)
        clock.run(2.0)
    speeds = robot.list_speeds()
    assert len(speeds) > 5
    for times_s in ([at_s for at_s, _ in speeds], [at_s for at_s, _ in robot.writes]):
        assert min(list_gaps_s(times_s)) > GATE_S
    assert [speed for _, speed in speeds[-2:]] == [0.0, 0.0]
    assert not robot.motors.is_turning


def test_a_velocity_waits_until_the_robot_acknowledges_the_one_before():
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock, network_s=0.2)
        for number in range(1, 100):
            robot.drive(0.001 * number)
            clock.run(0.02)
    assert min(list_gaps_s([at_s for at_s, _ in robot.writes])) >= 0.4


def test_velocity_position_and_servo_pulses_are_spaced_each_on_its_own():
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock)
        for _ in range(100):
            robot.drive(0.1, VELOCITY)
            robot.drive(0.2, POSITION)
            robot.command(MOTORS, b"\x78\x05\x40\x06")
            clock.run(0.01)
        robot.command(MOTORS, STOPPED_MOTORS)
        clock.run(1.0)
    assert [payload for _, name, payload in robot.taken if name == MOTORS][-2:] == [STOPPED_MOTORS] * 2
    for name in (VELOCITY, POSITION, MOTORS):
        times_s = [at_s for at_s, topic, _ in robot.taken if topic == name]
        assert min(list_gaps_s(times_s)) > GATE_S
        assert len(times_s) > 10, name


def test_a_robot_that_is_not_heard_gets_stops_and_no_motion():
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock)
        robot.peer.wheels.read_ticks(0.0, 0.0)
        clock.run(SILENCE_LIMIT_S + 0.1)
        robot.drive(0.1)
        clock.run(0.2)
        assert robot.taken == []
        robot.drive(0.0)
        robot.drive(0.2)
        clock.run(0.3)
        assert [speed for _, speed in robot.list_speeds()] == [0.0, 0.0]
        robot.peer.session.last_receive_s = clock.now_s
        clock.run(0.3)
    assert [speed for _, speed in robot.list_speeds()] == [0.0, 0.0, 0.2]


def test_an_old_command_is_dropped_when_it_could_not_be_sent_in_time():
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock, network_s=8.0)
        for speed_m_s in (0.1, 0.2):
            robot.drive(speed_m_s)
        clock.run(30.0)
    assert [speed for _, speed in robot.list_speeds()] == [0.1]


def test_a_robot_that_left_gets_nothing_more():
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock)
        for speed_m_s in itertools.repeat(0.1, 3):
            robot.drive(speed_m_s)
        robot.closed = True
        clock.run(1.0)
    assert len(robot.writes) == 1


@pytest.mark.parametrize(("silence_s", "is_sent"), [(0.45, True), (0.55, False)])
def test_motion_goes_to_a_robot_that_was_heard_in_the_last_half_second(silence_s, is_sent):
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock)
        robot.peer.wheels.read_ticks(0.0, 0.0)
        clock.run(silence_s)
        robot.drive(0.1)
        assert bool(robot.writes) == is_sent


def test_a_command_that_may_go_does_not_wait_for_the_timer_of_another():
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock)
        for speed_m_s in (0.1, 0.2):
            robot.drive(speed_m_s)
        clock.run(0.01)
        written = len(robot.writes)
        assert robot.peer.send_due
        robot.drive(0.1, POSITION)
        assert len(robot.writes) == written + 1


def test_a_command_for_what_the_robot_has_not_declared_costs_no_other():
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock)
        for name in ("/hero_1/gone", LIGHT):
            robot.bridge.commands.queue.offer(name, LIGHT_PAYLOAD)
        robot.peer.send_commands()
        clock.run(0.1)
    assert robot.bridge.commands.refused == 1
    assert [payload for _, name, payload in robot.taken if name == LIGHT] == [LIGHT_PAYLOAD]


def test_a_command_too_long_for_the_robot_is_reported_and_costs_no_other():
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock)
        for topic in robot.peer.session.topics.values():
            topic.info = topic.info._replace(buffer_length=64)
        for payload in (bytes(65), LIGHT_PAYLOAD):  # few enough to be sent in one go
            robot.bridge.commands.queue.offer(LIGHT, payload)
        robot.peer.send_commands()
        clock.run(0.1)
    assert len(robot.warnings) == 1 and "65 bytes does not fit the robot's buffer of 64 bytes" in robot.warnings[0]
    assert [payload for _, name, payload in robot.taken if name == LIGHT] == [LIGHT_PAYLOAD]
