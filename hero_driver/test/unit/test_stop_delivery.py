"""Stops in the driver's own time: whatever moves a robot and whenever it reads, it is at rest, and soon."""

from types import SimpleNamespace

import pytest
from commanded_robot import LIGHT, MOTORS, POSITION, VELOCITY, WINDOW_LENGTH, Clock, CommandedRobot
from hypothesis import given
from hypothesis import strategies as st

from hero_driver.commands.stop_progress import StopState
from hero_driver.rosserial.packets import RosserialError
from hero_driver.stops import delivery
from hero_driver.stops.delivery import BURST_LIGHTS, LIGHT_MD5, LIGHT_TYPE, encode_stop, is_light
from hero_node.ros_messages import MD5SUMS
from hero_test.fake_motors import LAG_S, FakeMotors

phases = st.floats(0.0, 0.051)
networks = st.floats(0.0, 0.05)
CONFIRMED_S = 0.5
"""A stop is confirmed so soon, beside what the network takes; self-tuning takes somewhat longer."""


TUNED_S = 2.0

FAST = b"\x78\x05\x40\x06"


def make_moving(clock, mover, lag_s=0.0, **settings):
    """Return a robot that has been moving for some time, with servo centers that are off."""
    motors = FakeMotors((1545, 1455), lag_s)
    robot = CommandedRobot(clock, has_readings=True, motors=motors, **settings)
    if mover == "pulses":
        robot.publish(MOTORS, FAST)
    elif mover == "both controllers":
        for name in (VELOCITY, POSITION):
            robot.publish_velocity(0.1, name)
    else:
        robot.motors.start_tuning(mover)
    clock.run(2.0)
    assert robot.motors.is_turning
    return robot


def stop(robot):
    robot.stopped = True
    robot.stops.begin(robot.peer)


def count_bursts(robot):
    return sum(len(data) > 62 * 24 for _, data in robot.writes)


@pytest.mark.parametrize("mover", ["pulses", "both controllers", "velocity_controller", "position_controller"])
@given(phase_s=phases, network_s=networks)
def test_a_stop_ends_whatever_moves_the_robot_and_is_confirmed_soon(mover, phase_s, network_s):
    with Clock().is_the_drivers() as clock:
        robot = make_moving(clock, mover, phase_s=phase_s, network_s=network_s)
        motor_packets = len(robot.list_motor_packets())
        stop(robot)
        clock.run(CONFIRMED_S + 4 * network_s + TUNED_S * mover.endswith("controller"))
        assert not robot.motors.is_turning
        assert robot.peer.stop.state is StopState.AT_REST
        written = len(robot.writes)
        clock.run(10.0)
    assert len(robot.writes) == written
    assert len(robot.list_motor_packets()) == motor_packets
    assert robot.warnings == [] or mover.endswith("controller")


@pytest.mark.parametrize("mover", ["pulses", "both controllers"])
@given(phase_s=phases, network_s=networks)
def test_an_ordinary_stop_of_wheels_with_a_lag_gets_no_burst(mover, phase_s, network_s):
    with Clock().is_the_drivers() as clock:
        robot = make_moving(clock, mover, lag_s=LAG_S, phase_s=phase_s, network_s=network_s)
        stop(robot)
        clock.run(1.0 + 4 * network_s)
        assert robot.peer.stop.state is StopState.AT_REST
    assert count_bursts(robot) == 0
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


@pytest.mark.parametrize("controller", ["velocity_controller", "position_controller"])
@given(phase_s=phases, network_s=networks)
def test_a_tuning_that_is_known_ends_with_one_write_that_fits_the_window(controller, phase_s, network_s):
    with Clock().is_the_drivers() as clock:
        robot = make_moving(clock, controller, phase_s=phase_s, network_s=network_s)
        robot.bridge.commands.note_tuning(True)
        del robot.writes[:]
        stop(robot)
        clock.run(CONFIRMED_S + 0.5 + 4 * network_s)
        assert robot.peer.stop.state is StopState.AT_REST
        assert not robot.bridge.commands.tunes(clock.now_s)
    assert BURST_LIGHTS * 24 == 1488
    assert WINDOW_LENGTH >= max(len(data) for _, data in robot.writes) >= BURST_LIGHTS * 24 + 2 * 56
    assert robot.list_motor_packets() == []


def test_repeated_stops_do_not_fill_the_window_of_a_tuning_robot():
    with Clock().is_the_drivers() as clock:
        robot = make_moving(clock, "velocity_controller")
        robot.bridge.commands.note_tuning(True)
        del robot.writes[:]
        stop(robot)
        for _ in range(3):
            clock.run(0.03)
            stop(robot)
        assert count_bursts(robot) == 1
        clock.run(CONFIRMED_S)
        assert robot.peer.stop.state is StopState.AT_REST


@pytest.mark.parametrize("light_s", [0.001, 0.0018, 0.0027, 0.005, 0.01, 0.03])
@given(phase_s=phases, network_s=networks)
def test_bursts_leave_the_robot_its_loop_however_long_a_light_takes(light_s, phase_s, network_s):
    with Clock().is_the_drivers() as clock:
        motors = FakeMotors((1545, 1455), LAG_S, light_s)
        robot = CommandedRobot(clock, has_readings=True, phase_s=phase_s, network_s=network_s, motors=motors)
        motors.start_tuning("velocity_controller")
        clock.run(2.0)
        robot.bridge.commands.note_tuning(True)
        stop(robot)
        clock.run(0.11 + network_s)
        assert not motors.is_tuning
        clock.run(1.5 + BURST_LIGHTS * light_s + 4 * network_s)
        assert robot.peer.stop.state is StopState.AT_REST
    assert robot.find_longest_read_s() <= (BURST_LIGHTS + 1) * light_s


@pytest.mark.parametrize("light_s", [0.0027, 0.01])
def test_a_robot_without_readings_gets_few_bursts_and_leaves_its_loop(light_s):
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock, motors=FakeMotors(light_s=light_s))
        robot.bridge.commands.was_told_to_tune = True
        stop(robot)
        clock.run(20.0)
        assert robot.peer.stop.state is StopState.UNCONFIRMED
    assert count_bursts(robot) == 2
    assert robot.find_longest_read_s() <= (BURST_LIGHTS + 1) * light_s


def test_programs_that_take_turns_bring_no_burst_into_another():
    with Clock().is_the_drivers() as clock:
        robot = make_moving(clock, "velocity_controller")
        robot.bridge.commands.was_told_to_tune = True
        del robot.writes[:]
        for number in range(100):
            robot.publish_velocity(0.1 * (number % 2), node="/program_%d" % (number % 2))
            robot.bridge.commands.was_told_to_tune = True
            clock.run(0.02)
    bursts_s = [at_s for at_s, data in robot.writes if len(data) > 62 * 24]
    assert len(bursts_s) > 3
    assert min(later_s - earlier_s for earlier_s, later_s in zip(bursts_s, bursts_s[1:])) > 0.062


def test_after_a_burst_the_light_has_the_color_that_it_had_before():
    with Clock().is_the_drivers() as clock:
        robot = make_moving(clock, "velocity_controller")
        for color in (b"old color......!", b"16 bytes of red!"):
            robot.bridge.commands._receive_command(LIGHT, color)
        robot.bridge.commands.was_told_to_tune = True
        clock.run(0.5)
        stop(robot)
        clock.run(3.0)
    lights = [payload for _, name, payload in robot.taken if name == LIGHT]
    assert len(lights) > BURST_LIGHTS
    assert lights[-1] == b"16 bytes of red!"


def test_no_stops_pile_up_in_front_of_a_robot_that_acknowledges_nothing():
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock, network_s=10.0)
        stop(robot)
        clock.run(4.0)
    assert len(robot.writes) == 1
    assert robot.peer.stop.state is StopState.STOPPING


@pytest.mark.parametrize("stopped", ["all", "this one"])
def test_a_release_right_after_a_stop_leaves_no_robot_moving(stopped):
    for offset_ms in range(0, 70, 3):
        with Clock().is_the_drivers() as clock:
            robot = CommandedRobot(clock, has_readings=True, phase_s=0.001 * (offset_ms % 51))
            clock.run(1.0)
            robot.publish_velocity(0.1)
            clock.run(0.001 * offset_ms)
            robot.stopped = stopped == "all"
            robot.stops.begin(robot.peer)
            clock.run(0.005)
            robot.stopped = False
            robot.stops.release()
            clock.run(CONFIRMED_S)
            assert not robot.motors.is_turning, offset_ms
            assert robot.peer.stop is None, offset_ms


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
    with Clock().is_the_drivers() as clock:
        clock.sleep = clock.run
        robot = make_moving(clock, "both controllers", phase_s=phase_s, network_s=network_s)
        robot.stopped, began_s = True, clock.now_s
        assert robot.stops.stop_and_wait([robot.peer], clock.now_s + 2.0, lambda peer: None) == []
    assert clock.now_s - began_s < CONFIRMED_S + 4 * network_s


def test_a_tuning_that_begins_right_after_a_release_goes_on():
    with Clock().is_the_drivers() as clock:
        robot = make_moving(clock, "pulses")
        stop(robot)
        clock.run(2.0)
        robot.stopped = False
        robot.stops.release()
        assert robot.peer.stop is None
        robot.motors.start_tuning("velocity_controller")
        clock.run(2.0)
        assert robot.motors.is_turning


def test_a_tuning_asked_for_while_a_stop_is_not_confirmed_goes_on():
    with Clock().is_the_drivers() as clock:
        robot = make_moving(clock, "pulses")
        stop(robot)
        clock.run(0.1)
        assert robot.peer.stop.state is not StopState.AT_REST
        robot.stopped = False
        robot.stops.release()
        service = "/hero_1/velocity_controller/pid_calibration"
        assert robot.bridge.commands.offer_request(service, "std_srvs/Trigger", b"") is None
        robot.motors.start_tuning("velocity_controller")
        clock.run(2.0)
        assert robot.motors.is_turning
        assert robot.bridge.commands.was_told_to_tune
        robot.stops.begin(robot.peer)
        clock.run(TUNED_S)
        assert not robot.motors.is_turning
        assert not robot.bridge.commands.was_told_to_tune


def test_a_motion_after_the_release_ends_the_zeros_of_the_stop():
    with Clock().is_the_drivers() as clock:
        robot = make_moving(clock, "both controllers")
        stop(robot)
        robot.stopped = False
        written = len(robot.writes)
        robot.publish_velocity(0.1)
        clock.run(5.0)
    assert len(robot.writes) == written + 1
    assert robot.writes[-1][0] - robot.writes[-2][0] > 0.05, "a motion within the firmware's gate of a stop"
    assert robot.motors.is_turning


@pytest.mark.parametrize("pause_s", [0.001, 0.01, 0.05, 0.1, 0.15, 0.2, 0.3])
def test_zeros_of_an_earlier_stop_do_not_end_servo_pulses(pause_s):
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock, has_readings=True)
        robot.publish_velocity(0.1, name=POSITION)
        clock.run(0.3)
        for name in (VELOCITY, POSITION):  # as a program does that stops whichever controller drives
            robot.publish_velocity(0.0, name=name)
        clock.run(pause_s)
        robot.publish(MOTORS, FAST)
        clock.run(0.9)
        assert robot.taken[-1][1:] == (MOTORS, FAST)
        assert robot.motors.is_turning
    assert len([name for _, name, _ in robot.taken if name == MOTORS]) == 1


def test_only_what_colors_the_light_is_lit_in_a_stop():
    for name, message_type, md5sum, is_lit in (
        ("/hero_1/led", LIGHT_TYPE, LIGHT_MD5, True),
        ("/hero_1/led", LIGHT_TYPE, "0" * 32, False),
        ("/hero_1/led", "std_msgs/String", LIGHT_MD5, False),
        ("/hero_1/seen_color", LIGHT_TYPE, LIGHT_MD5, False),
    ):
        info = SimpleNamespace(name=name, message_type=message_type, md5sum=md5sum)
        assert is_light(SimpleNamespace(info=info)) == is_lit


def test_a_robot_that_only_motor_commands_reach_is_stopped_by_them():
    twist, motor = "geometry_msgs/Twist", "hero_msgs/Motor"
    kind = SimpleNamespace(is_from_robot=False)

    def encode(topic_id, payload):
        if topic_id == 9:
            raise RosserialError("its buffer is too small")
        return b"%d," % topic_id

    def stop_by(*topics, with_burst=False):
        infos = [
            SimpleNamespace(name=LIGHT, message_type=name, md5sum=MD5SUMS.get(name, LIGHT_MD5)) for _, name in topics
        ]
        topics = {topic_id: SimpleNamespace(info=info, kind=kind) for (topic_id, _), info in zip(topics, infos)}
        session = SimpleNamespace(topics=topics, encode_message=encode)
        return encode_stop(SimpleNamespace(session=session, bridge=None), with_burst)

    light = (4, LIGHT_TYPE)
    assert stop_by((1, motor), (2, twist), (3, twist), light) == b"2,3,", "the controllers overwrite pulses"
    assert stop_by((1, motor), (9, twist), light) == stop_by((1, motor), light) == b"1,"
    assert stop_by((9, twist), (2, twist)) == b"2,", "a topic that is refused leaves the next one its zero"
    assert stop_by((9, twist), (1, motor)) == b"1,"
    assert stop_by((1, motor), light, with_burst=True) == b"4," * BURST_LIGHTS + b"1,"
    assert stop_by((1, "nav_msgs/Odometry"), light) == b""


def test_a_robot_that_was_released_is_stopped_again_as_the_first_time():
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock, has_readings=True)
        for _ in range(2):
            robot.publish_velocity(0.1)
            clock.run(1.0)
            stop(robot)
            clock.run(CONFIRMED_S)
            assert robot.peer.stop.state is StopState.AT_REST and not robot.motors.is_turning
            robot.stopped = False
            clock.run(1.0)
            assert robot.peer.stop is None and not robot.stops._peers


def test_a_deadline_that_has_come_is_not_waited_for():
    with Clock().is_the_drivers() as clock:
        robot = make_moving(clock, "pulses")
        assert robot.stops.stop_and_wait([robot.peer], clock.now_s, None) == [robot.peer]
        robot.peer.link.closed = True  # nor is a robot that has left waited for
        assert robot.stops.stop_and_wait([robot.peer], clock.now_s + 2.0, None) == [robot.peer]


def test_the_end_reads_and_advances_until_all_rest_or_its_deadline():
    with Clock().is_the_drivers() as clock:
        clock.sleep = clock.run
        robot = CommandedRobot(clock, has_readings=True)
        robot.publish_velocity(0.1)
        clock.run(1.0)
        robot.stopped, began_s, reads = True, clock.now_s, []
        assert robot.stops.stop_and_wait([robot.peer], began_s + 2.0, reads.append) == []
        assert clock.now_s - began_s < CONFIRMED_S and not robot.motors.is_turning
        assert set(map(id, reads)) == {id(robot.peer)}
        robot.motors.is_pushed = True
        began_s = clock.now_s
        robot.peer.stop = None
        assert robot.stops.stop_and_wait([robot.peer], began_s + 2.0, reads.append) == [robot.peer]
        assert 2.0 <= clock.now_s - began_s < 2.03


def test_a_robot_that_has_left_holds_up_the_stops_of_no_other(monkeypatch):
    monkeypatch.setattr(delivery, "_is_pending", lambda peer: False)
    stops = delivery.StopDelivery(lambda delay_s, call: None, SimpleNamespace(stopped=True, note_change=lambda: None))
    gone, there = (
        SimpleNamespace(stop=object(), bridge=None, link=SimpleNamespace(closed=is_closed))
        for is_closed in (True, False)
    )
    advanced = []
    monkeypatch.setattr(stops, "_advance", lambda peer, now_s: advanced.append(peer))
    stops._peers = [gone, there]
    stops._poll()
    assert advanced == stops._peers == [there]


def test_a_bug_with_one_robot_keeps_the_stops_of_the_others_going(monkeypatch):
    """The robot whose stop fails comes first, and loses its connection; the next one is stopped until it rests."""
    with Clock().is_the_drivers() as clock:
        broken, whole = (make_moving(clock, "both controllers") for _ in range(2))
        bugs, closed = [], []
        whole.report_bug, broken.peer.link.close = bugs.append, closed.append
        broken.peer.has_acknowledged_motion = lambda: 1 / 0
        whole.stopped = True
        for peer in (broken.peer, whole.peer):
            whole.stops.begin(peer)
        clock.run(CONFIRMED_S)
        assert whole.peer.stop.state is StopState.AT_REST and not whole.motors.is_turning
        assert closed[0] == "a bug of the driver" and isinstance(bugs[0], ZeroDivisionError)
