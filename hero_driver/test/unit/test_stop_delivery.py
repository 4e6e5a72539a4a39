"""Stops in the driver's own time: whatever moves a robot and whenever it reads, it is at rest, and soon."""

import pytest
from commanded_robot import MOTORS, POSITION, VELOCITY, WINDOW_LENGTH, Clock, CommandedRobot
from hypothesis import given
from hypothesis import strategies as st

from hero_driver.commands.stop_progress import StopState
from hero_driver.commands.velocity_shaper import STOPPED_MOTORS

phases = st.floats(0.0, 0.051)
networks = st.floats(0.0, 0.05)
CONFIRMED_S = 0.5
"""A stop is confirmed so soon, beside what the network takes; self-tuning takes somewhat longer."""


def make_moving(clock, mover, **settings):
    """Return a robot that has been moving for some time."""
    robot = CommandedRobot(clock, has_readings=True, **settings)
    if mover == "pulses":
        robot.command(MOTORS, b"\x78\x05\x40\x06")
    elif mover == "both controllers":
        for name in (VELOCITY, POSITION):
            robot.drive(0.1, name)
    else:
        robot.motors.start_tuning(mover)
    clock.run(2.0)
    assert robot.motors.is_turning
    return robot


def stop(robot):
    robot.is_stopped = True
    robot.stops.begin(robot.peer)


@pytest.mark.parametrize("mover", ["pulses", "both controllers", "velocity_controller", "position_controller"])
@given(phase_s=phases, network_s=networks)
def test_a_stop_ends_whatever_moves_the_robot_and_is_confirmed_soon(mover, phase_s, network_s):
    with Clock().is_the_drivers() as clock:
        robot = make_moving(clock, mover, phase_s=phase_s, network_s=network_s)
        stop(robot)
        clock.run(CONFIRMED_S + 4 * network_s + 1.5 * mover.endswith("controller"))
        assert not robot.motors.is_turning
        assert robot.peer.stop.state is StopState.AT_REST
        written = len(robot.writes)
        clock.run(10.0)
    assert len(robot.writes) == written
    assert robot.warnings == []


def test_a_motion_just_before_a_stop_does_not_swallow_it():
    for offset_ms in range(60):
        with Clock().is_the_drivers() as clock:
            robot = CommandedRobot(clock, has_readings=True)
            clock.run(1.0 + 0.001 * offset_ms)
            robot.drive(0.1)
            stop(robot)
            clock.run(CONFIRMED_S)
            assert not robot.motors.is_turning, offset_ms
            assert robot.peer.stop.state is StopState.AT_REST, offset_ms


def test_the_stop_of_a_self_tuning_robot_fits_its_window_in_one_write():
    with Clock().is_the_drivers() as clock:
        robot = make_moving(clock, "velocity_controller")
        robot.bridge.note_tuning(True)
        del robot.writes[:]
        stop(robot)
        clock.run(3.0)
    assert not robot.motors.is_turning
    assert max(len(data) for _, data in robot.writes) <= WINDOW_LENGTH
    assert max(data.count(STOPPED_MOTORS) for _, data in robot.writes) > 110


def test_wheels_that_turn_although_stopped_are_reported_and_stopped():
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock, has_readings=True)
        robot.motors.is_pushed = True
        clock.run(1.0)
        stop(robot)
        clock.run(2.0)
        assert robot.peer.stop.state is StopState.MOVING
        assert robot.warnings == ["its wheels turn although it was stopped"]
        written = len(robot.writes)
        clock.run(20.0)
        assert len(robot.writes) > written
        robot.motors.is_pushed = False
        clock.run(3.0)
        assert robot.peer.stop.state is StopState.AT_REST


@given(phase_s=phases, network_s=networks)
def test_the_end_waits_for_rest_and_no_longer(phase_s, network_s):
    ended = []
    with Clock().is_the_drivers() as clock:
        robot = make_moving(clock, "both controllers", phase_s=phase_s, network_s=network_s)
        stop(robot)
        robot.stops.await_rest([robot.peer], clock.now_s + 2.0, lambda doubtful: ended.append((clock.now_s, doubtful)))
        began_s = clock.now_s
        clock.run(5.0)
    ((ended_s, doubtful),) = ended
    assert doubtful == []
    assert ended_s - began_s < CONFIRMED_S + 4 * network_s


def test_the_end_waits_until_its_deadline_for_a_robot_that_does_not_rest():
    ended = []
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock, has_readings=True)
        robot.motors.is_pushed = True
        clock.run(1.0)
        stop(robot)
        robot.stops.await_rest([robot.peer], clock.now_s + 2.0, lambda doubtful: ended.append((clock.now_s, doubtful)))
        clock.run(1.9)
        assert ended == []
        clock.run(0.2)
    assert [doubtful for _, doubtful in ended] == [[robot.peer]]


def test_a_released_robot_is_not_stopped_any_more():
    with Clock().is_the_drivers() as clock:
        robot = make_moving(clock, "both controllers")
        stop(robot)
        robot.is_stopped = False
        robot.stops.release()
        written = len(robot.writes)
        robot.drive(0.1)
        clock.run(5.0)
    assert len(robot.writes) == written + 1
    assert robot.writes[-1][0] - robot.writes[-2][0] > 0.05, "a motion within the firmware's gate of a stop"
    assert robot.motors.is_turning
