"""Programs that command one robot: which of them hangs, and what a stop of one has to end."""

import pytest
from commanded_robot import MOTORS, POSITION, VELOCITY, Clock, CommandedRobot
from hypothesis import given
from hypothesis import strategies as st

from hero_driver.commands.command_sources import RATE_MAX_HZ, STUCK_READINGS, CommandSource, CommandSources
from hero_driver.commands.velocity_shaper import STOPPED_MOTORS, ZERO_TWIST
from hero_driver.corrections.wheel_motion import WheelMotion
from hero_driver.transport.event_loop import POLL_INTERVAL_S
from hero_node.robot_constants import MAX_WATCHDOG_S
from hero_test.fake_motors import LAG_S, FakeMotors

NAN_TWIST = bytes(6) + b"\xf8\x7f" + bytes(40)
STOP_S = 0.5


@pytest.mark.parametrize("name", [VELOCITY, POSITION])
@pytest.mark.parametrize(("rate_hz", "stopped_s"), [(5, 0.8), (10, 0.5), (20, 0.5), (100, 0.5)])
def test_a_regular_commander_that_falls_silent_is_stopped(name, rate_hz, stopped_s):
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock, has_readings=True)
        robot.publish_at(rate_hz, 2.0, name=name)
        clock.run(stopped_s - 1.0 / rate_hz - 0.02)
        assert robot.motors.is_turning
        clock.run(STOP_S)
        assert not robot.motors.is_turning
    assert "/program, which commands it regularly, has been silent" in robot.lines[0]
    assert len(robot.lines) == 1


@pytest.mark.parametrize("commands", [1, 2, 3])
def test_single_commands_keep_the_meaning_that_the_firmware_gives_them(commands):
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock, has_readings=True)
        robot.publish_at(10, 0.1 * commands)
        clock.run(5.0)
        assert robot.motors.is_turning
    assert robot.lines == []


@given(pauses_s=st.lists(st.floats(0.0, 0.45), min_size=5, max_size=40))
def test_a_program_with_jitter_is_never_classified_as_hung(pauses_s):
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock, has_readings=True)
        for pause_s in pauses_s:
            robot.publish_velocity(0.1)
            clock.run(pause_s)
    assert robot.lines == []


def find_silence_s(period_s, end_s, pauses, is_read_first=True, until_s=6.0):
    """Return when a program is found silent that commands until end_s; the driver does not run in pauses (s, s)."""
    commanders, next_s, now_s = CommandSources(WheelMotion()), 0.0, 0.0
    while now_s < until_s:
        now_s = next((after_s for before_s, after_s in pauses if before_s <= now_s < after_s), now_s)
        is_silent = not is_read_first and commanders.find_silent(STOP_S, now_s) is not None
        while next_s <= min(now_s, end_s):
            commanders.note_command(VELOCITY, VELOCITY, "sender", "/program", True, now_s)
            next_s += period_s
        if is_silent or commanders.find_silent(STOP_S, now_s) is not None:
            return now_s
        now_s += POLL_INTERVAL_S
    return None


@given(
    period_s=st.floats(0.02, 0.12),
    begin_s=st.floats(1.0, 2.0),
    pause_s=st.floats(0.2, 3.0),
    is_read_first=st.booleans(),
)
def test_a_pause_of_the_driver_itself_is_no_silence_of_a_program(period_s, begin_s, pause_s, is_read_first):
    pauses = [(begin_s, begin_s + pause_s)]
    assert find_silence_s(period_s, 9.0, pauses, is_read_first) is None
    # The program is suspended as well.
    commanders, commands = CommandSources(WheelMotion()), int(begin_s / period_s)
    for index in range(commands):
        commanders.note_command(VELOCITY, VELOCITY, "sender", "/program", True, index * period_s)
        assert commanders.find_silent(STOP_S, index * period_s) is None
    for look_s in (0.0, period_s / 2.0):
        assert commanders.find_silent(STOP_S, (commands - 1) * period_s + pause_s + look_s) is None


@given(
    period_s=st.floats(0.02, 0.12),
    pauses=st.lists(st.tuples(st.floats(0.0, 0.5), st.floats(0.25, 0.9)), min_size=1, max_size=8),
)
def test_pauses_of_the_driver_keep_no_robot_of_a_hung_program_moving(period_s, pauses):
    times_s, end_s = [], 2.0
    for running_s, pause_s in pauses:
        begin_s = (times_s[-1][1] if times_s else end_s) + running_s
        times_s.append((begin_s, begin_s + pause_s))
    longest_s = max(pause_s for _, pause_s in pauses)
    stopped_s = find_silence_s(period_s, end_s, times_s, until_s=20.0)
    # One pause that does not count, and one in which the time is over.
    assert stopped_s <= end_s + max(STOP_S, 4.0 * period_s) + 2.0 * longest_s + 2.0 * POLL_INTERVAL_S + 0.2


# What a stop has to end.


@pytest.mark.parametrize("name", [VELOCITY, POSITION])
@pytest.mark.parametrize("hang_s", [0.05, 0.1, 0.2, 0.4, 0.7, 1.0, 2.0])
@pytest.mark.parametrize("driven_s", [0.1, 0.3, 1.0])
def test_a_robot_that_hangs_while_it_is_told_to_stop_stops_when_it_goes_on(name, hang_s, driven_s):
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock, has_readings=True)
        robot.publish_at(10, driven_s, name=name)
        robot.hang(hang_s)
        robot.publish_velocity(0.1, name=name)
        clock.run(0.05)
        robot.publish_velocity(0.0, name=name)
        clock.run(max(hang_s, STOP_S) + 0.35)
        assert not robot.motors.is_turning


def test_an_ordinary_zero_is_sent_twice_and_no_more_if_it_works():
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock, has_readings=True, motors=FakeMotors(lag_s=LAG_S))
        robot.publish_at(10, 2.0)
        written = len(robot.writes)
        robot.publish_velocity(0.0)
        clock.run(3.0)
    assert len(robot.writes) == written + 2


@pytest.mark.parametrize("mover", [VELOCITY, POSITION, MOTORS])
@pytest.mark.parametrize(("topic", "stop"), [(VELOCITY, ZERO_TWIST), (POSITION, ZERO_TWIST), (MOTORS, STOPPED_MOTORS)])
@pytest.mark.parametrize("node", ["/program", "/other"])
def test_a_stop_on_one_motion_topic_ends_what_came_through_another(mover, topic, stop, node):
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock, has_readings=True)
        payload = b"\x78\x05\x40\x06" if mover == MOTORS else bytes(6) + b"\xf0\x3f" + bytes(40)
        robot.publish(mover, payload)
        clock.run(1.0)
        assert robot.motors.is_turning
        robot.publish(topic, stop, node=node)
        clock.run(STOP_S)
        assert not robot.motors.is_turning


@pytest.mark.parametrize("mover", [POSITION, MOTORS])
@given(overtaken_s=st.floats(0.0, 0.05), again_s=st.floats(0.055, 0.095), phase_s=st.floats(0.0, 0.051))
def test_what_a_programs_zero_overtook_does_not_move_the_robot(mover, overtaken_s, again_s, phase_s):
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock, phase_s=phase_s, has_readings=True)
        payload = b"\x78\x05\x40\x06" if mover == MOTORS else bytes(6) + b"\xf0\x3f" + bytes(40)
        for _ in range(10):
            robot.publish(mover, payload)
            clock.run(0.1)
        taken = len(robot.taken)
        robot.publish(VELOCITY, ZERO_TWIST)
        clock.run(overtaken_s)
        robot.publish(mover, payload)
        clock.run(again_s - overtaken_s)
        robot.publish(VELOCITY, ZERO_TWIST)
        clock.run(STOP_S)
        assert not robot.motors.is_turning
    assert {payload for _, _, payload in robot.taken[taken:]} <= {ZERO_TWIST}


def test_a_stop_leaves_what_another_program_drives_at_this_moment():
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock, has_readings=True)
        robot.publish_at(5, 2.0, name=POSITION, node="/other")
        robot.publish_velocity(0.0)
        clock.run(0.3)
        assert robot.motors.is_turning
        robot.publish_at(5, 1.0, name=POSITION, node="/other")
        clock.run(3.0)
        assert not robot.motors.is_turning, "the other program fell silent"


@pytest.mark.parametrize("controller", ["velocity_controller", "position_controller"])
@pytest.mark.parametrize("name", [VELOCITY, POSITION])
@pytest.mark.parametrize("payload", [ZERO_TWIST, NAN_TWIST], ids=["zero", "NaN"])
def test_an_ordinary_stop_ends_a_tuning_that_the_driver_knows_of(controller, name, payload):
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock, has_readings=True)
        clock.run(1.0)
        calibration = "/hero_1/%s/pid_calibration" % controller
        robot.bridge.ids[calibration] = 1000
        assert robot.bridge.commands.offer_request(calibration, "std_srvs/Trigger", b"") is None
        robot.motors.start_tuning(controller)
        clock.run(2.0)
        robot.publish(name, payload)
        clock.run(1.0)
        assert not robot.motors.is_turning
        assert not robot.bridge.commands.tunes(clock.now_s)


def test_after_a_pause_of_the_driver_a_command_that_waited_is_forgotten():
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock, network_s=0.3, has_readings=True)
        robot.publish_velocity(0.05)
        robot.publish_velocity(0.1)
        robot.bridge.commands.queue.discard_motion(clock.now_s)
        clock.run(2.0)
    assert [speed for _, speed in robot.list_speeds()] == [0.05]


@pytest.mark.parametrize(("turn_s", "warnings"), [(0.2, 1), (0.984375, 1), (1.0, 0), (1.5, 0)])
def test_programs_take_turns_if_one_commands_again_within_a_second(turn_s, warnings):
    with Clock().is_the_drivers() as clock:
        robot = CommandedRobot(clock, has_readings=True)
        for node in ("/first", "/second", "/first"):
            robot.publish_velocity(0.1, node=node)
            clock.run(turn_s)
    expected = "hero_1 is commanded by /first and /second at once and obeys the newest command: end one of them"
    assert robot.lines == [expected] * warnings


def test_motion_counts_until_the_firmware_has_ended_it():
    commanders = CommandSources(WheelMotion())
    commanders.note_command(POSITION, "a", "sender", "/other", True, 100.0)
    for now_s, is_moving in ((100.0 + MAX_WATCHDOG_S - 0.01, True), (100.0 + MAX_WATCHDOG_S + 0.01, False)):
        stopper = commanders.note_command(VELOCITY, "b", "sender", "/program", False, now_s)
        assert commanders.needs_another_stop(stopper, now_s) == is_moving


def test_a_forgiven_pause_never_puts_the_last_command_into_the_future():
    commander = CommandSource("sender", "/program", VELOCITY)
    for index in range(8):
        commander.note_command(True, 0.1 * index)
    commander.forgive_pause(0.9, 1.0)
    assert commander.commanded_s == 1.0
    assert not commander.has_fallen_silent(0.4, 1.3) and commander.has_fallen_silent(0.4, 1.5)
    commander.forgive_pause(0.5, 1.6)
    assert commander.commanded_s == 1.0, "once between two commands"


def make_commander(intervals_s):
    """Return a commander of these intervals between its commands, and when its last one came."""
    commander, now_s = CommandSource("sender", "/program", VELOCITY), 0.0
    for interval_s in (8.0, *intervals_s):
        now_s += interval_s
        commander.note_command(True, now_s)
    return commander, now_s


def test_six_commands_are_regular_and_eight_intervals_tell_the_period():
    for intervals_s, period_s in (
        ([0.25] * 4, None),
        ([0.25] * 5, 0.25),
        ([0.5, *[0.25] * 7], 0.5),
        ([0.5, *[0.25] * 8], 0.25),
        ([4.0] * 5, 4.0),
        ([4.25] * 9, None),
    ):
        assert make_commander(intervals_s)[0].find_period_s() == period_s, intervals_s


def test_silence_counts_from_the_limit_and_from_four_periods_on():
    for period_s, silence_s, is_silent in (
        (0.25, 1.0, True),
        (0.25, 0.96875, False),
        (0.0625, 0.5, True),
        (0.0625, 0.46875, False),
    ):
        commander, now_s = make_commander([period_s] * 6)
        assert commander.has_fallen_silent(0.5, now_s + silence_s) == is_silent, (period_s, silence_s)
    assert not make_commander([0.25] * 4)[0].has_fallen_silent(0.5, 1000.0)


def test_what_a_program_does_after_a_silence_tells_its_period_anew():
    commander, now_s = make_commander([0.125] * 8)
    commander.note_command(True, now_s + 0.5)
    assert commander.find_period_s() is None
    commander, now_s = make_commander([0.125] * 8)
    commander.note_command(True, now_s + 0.46875)
    assert commander.find_period_s() == 0.46875


def test_a_look_after_more_than_0_2_s_does_not_count_that_time_as_silence():
    for pause_s, is_forgiven in ((0.2, False), (0.203125, True)):
        commanders = CommandSources(WheelMotion())
        commander = commanders.note_command(VELOCITY, VELOCITY, "sender", "/program", True, 0.0)
        commanders.find_silent(STOP_S, 0.0)
        commanders.find_silent(STOP_S, pause_s)
        assert commander.commanded_s == is_forgiven * pause_s


def test_a_zero_is_missed_unless_two_readings_after_it_show_rest():
    for readings, still, after_s, is_missed in (
        (0, 0, 0.5, True),
        (5, 0, 0.5, True),
        (5, 1, 0.5, True),
        (5, 2, 0.5, False),
        (5, 0, 0.49, False),
    ):
        wheels = WheelMotion()
        wheels.read_ticks(0.0, 0.0)
        commanders = CommandSources(wheels)
        for moves in (True, False):
            commanders.note_command(VELOCITY, VELOCITY, "sender", "/program", moves, 0.0)
        for number in range(readings):
            wheels.read_ticks(-100.0 * min(number, readings - still - 1), 0.0)
        assert commanders.is_zero_missed(after_s) == is_missed, (readings, still, after_s)
        assert not commanders.is_zero_missed(after_s + 1.0) or after_s < 0.5, "said once"


def test_a_zero_is_not_missed_without_motion_or_before_motion_or_a_stop():
    for commands, has_readings, is_stopped in (
        ((True, False), False, False),
        ((False,), True, False),
        ((True, False, True), True, False),
        ((True, False), True, True),
    ):
        wheels = WheelMotion()
        if has_readings:
            wheels.read_ticks(0.0, 0.0)
        commanders = CommandSources(wheels)
        for moves in commands:
            commanders.note_command(VELOCITY, VELOCITY, "sender", "/program", moves, 0.0)
        if is_stopped:
            commanders.stop()
        assert not commanders.is_zero_missed(9.0)


def test_a_rival_keeps_its_robot_for_half_a_second_of_silence():
    for silence_s, node, has_more in (
        (0.46875, "/other", False),
        (0.5, "/other", True),
        (0.46875, "/program", True),
    ):
        commanders = CommandSources(WheelMotion())
        for number in range(8):
            commanders.note_command(POSITION, "a", "sender", node, True, 0.125 * number)
        now_s = 0.875 + silence_s
        stopper = commanders.note_command(VELOCITY, "b", "another", "/program", False, now_s)
        assert commanders.needs_another_stop(stopper, now_s) == has_more, (silence_s, node)


def test_as_many_commands_as_the_limit_in_a_second_are_no_fault():
    for commands, is_fault in ((int(RATE_MAX_HZ), False), (int(RATE_MAX_HZ) + 1, True)):
        sources = CommandSources(WheelMotion())
        for _ in range(commands):
            sources.note_command(VELOCITY, VELOCITY, None, "/mine", True, 10.0)
        assert bool(sources.find_fault(10.0)) == is_fault


def test_wheels_that_do_not_turn_for_five_seconds_of_commands_are_told():
    wheels = WheelMotion()
    sources = CommandSources(wheels)

    def command(moves, now_s, ticks=0.0, topic=VELOCITY):
        sources.note_command(topic, topic, None, "/mine", moves, now_s)
        wheels.read_ticks(ticks, ticks)
        return sources.find_fault(now_s)

    for reading in range(2 * STUCK_READINGS):
        assert command(False, reading / 29.0) == "", "at rest"
    now_s = 2 * STUCK_READINGS / 29.0
    told = [command(True, now_s + reading / 29.0) for reading in range(STUCK_READINGS)]
    assert not any(told[:-1])
    assert "have not turned for 5 s, although /mine commands it" in told[-1]
    assert command(True, now_s + 6.0, ticks=9.0) == ""
    for reading in range(2 * STUCK_READINGS):
        wheels.read_ticks(9.0, 9.0)
        told = sources.find_fault(now_s + 6.0 + reading / 29.0)
    assert told == "", "after one command, which the robot ends by itself"
    for reading in range(2 * STUCK_READINGS):
        assert command(True, now_s + 20.0 + reading / 29.0, 9.0, MOTORS) == "", "pulses may be those of rest"


def test_a_loop_that_does_not_sleep_is_told_while_it_runs():
    sources = CommandSources(WheelMotion())

    def command(rate_hz, start_s):
        for count in range(2 * int(rate_hz)):
            now_s = start_s + count / rate_hz
            sources.note_command(VELOCITY, VELOCITY, None, "/mine", True, now_s)
            fault = sources.find_fault(now_s)
        return fault

    assert command(RATE_MAX_HZ, 0.0) == ""
    assert "/mine sends 500 commands per second" in command(500.0, 10.0)
    assert command(10.0, 20.0) == ""
