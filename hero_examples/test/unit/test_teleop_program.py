"""teleop and teleop_joy in virtual time: keys and sticks drive robots; letting go, silence and the end stop them."""

from types import SimpleNamespace

import pytest
import true_paths

from hero_sim.stepped import StepSwarm

pytest.importorskip("rospy", reason="teleoperation imports rospy")
from hero_client.apps.joystick_teleop import JoystickMapping, JoystickTeleop
from hero_client.apps.keyboard_teleop import KeyboardTeleop

MAPPING = JoystickMapping(0.15, 2.0, linear_axis=1, angular_axis=0, enable_button=4, stop_button=1)


class Drivers:
    """The drivers' side of a stop of all robots."""

    def __init__(self):
        self.requests = []

    def request_stop(self, stopped):
        self.requests.append(stopped)

    def stop_status(self):
        return None

    def read(self):
        return None


def record_commands(robot):
    """Return a list that grows by (ms, linear, angular) with each command that the robot is sent from now on."""
    sent, send = [], robot._link.send_velocity

    def send_and_note(linear_m_s, angular_rad_s):
        sent.append((round(robot.now_s * 1000.0), linear_m_s, angular_rad_s))
        send(linear_m_s, angular_rad_s)

    robot._link.send_velocity = send_and_note
    return sent


@pytest.fixture()
def swarm():
    swarm = StepSwarm(2, arena="empty")
    swarm.drivers = Drivers()
    return swarm


def hang(swarm):
    """Let the program do nothing for a second, as if it were suspended."""
    true_paths.run(swarm, lambda time_s: None, 1.0, hz=20.0)


def use_keys(swarm, teleop, presses, duration_s):
    """Press keys at their times, (s, key), while teleop takes its steps as often as the program does."""
    presses = [(swarm.now_s + time_s, key) for time_s, key in presses]

    def step(time_s):
        while presses and presses[0][0] <= swarm.now_s:
            teleop.press(presses.pop(0)[1], swarm.now_s)
        teleop.step(swarm.now_s)

    true_paths.run(swarm, step, duration_s, hz=20.0)


def hold(key, duration_s):
    """Return the presses of a key that is held: once, and repeated after 0.5 s, every 40 ms."""
    return [(0.0, key)] + [(0.5 + 0.04 * number, key) for number in range(int((duration_s - 0.5) / 0.04))]


def test_a_held_key_drives_and_letting_go_stops_it_with_one_command(swarm):
    teleop, sent = KeyboardTeleop(swarm, 0.1, 1.5), record_commands(swarm[0])
    use_keys(swarm, teleop, hold("w", 2.0), 2.0)
    assert swarm[0].velocity.linear_m_s > 0.08
    use_keys(swarm, teleop, [], 0.6)
    assert swarm[0].velocity.linear_m_s < 0.02
    use_keys(swarm, teleop, [], 2.0)
    assert true_paths.stop_within(swarm, 0.0)
    zeros_ms = [time_ms for time_ms, linear_m_s, angular_rad_s in sent if linear_m_s == angular_rad_s == 0.0]
    assert len(zeros_ms) == 1
    assert swarm.now_s * 1000.0 - zeros_ms[-1] > 1000.0  # then it is silent: other programs may drive


def test_keys_stop_the_robot_also_after_the_program_hung(swarm):
    teleop, sent = KeyboardTeleop(swarm, 0.1, 1.5), record_commands(swarm[0])
    use_keys(swarm, teleop, hold("w", 1.0), 1.0)
    hang(swarm)
    use_keys(swarm, teleop, [], 0.2)
    assert sent[-1][1:] == (0.0, 0.0)


@pytest.mark.parametrize("key", ["s", " "])
def test_a_stop_key_stops_at_once(swarm, key):
    teleop, sent = KeyboardTeleop(swarm, 0.1, 1.5), record_commands(swarm[0])
    use_keys(swarm, teleop, [*hold("w", 1.0), (1.0, key)], 1.1)
    assert sent[-1][1:] == (0.0, 0.0)
    use_keys(swarm, teleop, [], 0.3)
    assert true_paths.stop_within(swarm, 0.2)


def test_the_robot_that_is_left_by_a_key_stops_and_the_other_drives(swarm):
    teleop = KeyboardTeleop(swarm, 0.1, 1.5)
    use_keys(swarm, teleop, hold("w", 1.0), 1.0)
    assert [robot.driven for robot in swarm] == [True, False]
    use_keys(swarm, teleop, [(0.0, "1"), *hold("x", 1.0)], 1.0)
    assert swarm[0].velocity == (0.0, 0.0) and swarm[1].velocity.linear_m_s < -0.05
    use_keys(swarm, teleop, [(0.0, "g"), *hold("a", 1.0)], 1.0)
    assert all(robot.velocity.angular_rad_s > 0.5 for robot in swarm)


def test_enter_stops_all_robots_of_all_drivers_and_r_releases_them(swarm, capsys):
    teleop = KeyboardTeleop(swarm, 0.1, 1.5)
    use_keys(swarm, teleop, [*hold("w", 1.0), (1.0, "\r")], 1.1)
    assert swarm.drivers.requests == [True]
    swarm.emergency_stop()
    use_keys(swarm, teleop, [], 0.1)
    use_keys(swarm, teleop, hold("w", 1.0), 1.0)
    assert "all robots are stopped, so hero_0 cannot move" in capsys.readouterr().out
    assert swarm[0].velocity == (0.0, 0.0)
    use_keys(swarm, teleop, [(0.0, "r")], 0.1)
    assert swarm.drivers.requests == [True, False]


def make_joy(linear, enabled=True, stop=False, pressed=(), turn=0.0):
    buttons = [0, int(stop), 0, 0, int(enabled), 0]
    return SimpleNamespace(axes=[turn, linear], buttons=[int(bool(on) or n in pressed) for n, on in enumerate(buttons)])


def use_stick(swarm, teleop, joy, duration_s):
    """Let the joystick send this message at 20 Hz; None: it is silent."""

    def step(time_s):
        if joy is not None:
            teleop.receive(joy)
        if round(time_s * 20.0) % 2 == 0:
            teleop.step(swarm.now_s)

    true_paths.run(swarm, step, duration_s, hz=20.0)


def test_a_stick_drives_while_its_button_is_held(swarm):
    teleop = JoystickTeleop(swarm, MAPPING)
    use_stick(swarm, teleop, make_joy(-0.4), 2.0)
    assert all(-0.08 < robot.velocity.linear_m_s < -0.04 for robot in swarm)
    use_stick(swarm, teleop, make_joy(-0.4, enabled=False), 0.5)
    assert true_paths.stop_within(swarm, 0.2)


def test_a_silent_joystick_stops_the_robots_before_their_watchdogs(swarm):
    teleop, sent = JoystickTeleop(swarm, MAPPING), record_commands(swarm[0])
    use_stick(swarm, teleop, make_joy(1.0), 1.0)
    use_stick(swarm, teleop, None, 0.7)
    assert sent[-1][1:] == (0.0, 0.0)
    use_stick(swarm, teleop, None, 2.0)
    assert swarm.now_s - sent[-1][0] / 1000.0 > 1.0  # then it is silent


def test_a_stick_stops_the_robots_also_after_the_program_hung(swarm):
    teleop, sent = JoystickTeleop(swarm, MAPPING), record_commands(swarm[0])
    use_stick(swarm, teleop, make_joy(1.0), 1.0)
    hang(swarm)
    use_stick(swarm, teleop, None, 0.3)
    assert sent[-1][1:] == (0.0, 0.0)


@pytest.mark.parametrize("is_heard_first", [True, False])
def test_stick_input_during_a_pause_of_the_program_drives_no_robot(swarm, is_heard_first):
    teleop, sent = JoystickTeleop(swarm, MAPPING), record_commands(swarm[0])
    use_stick(swarm, teleop, make_joy(1.0), 1.0)
    hang(swarm)
    del sent[:]
    if is_heard_first:
        teleop.receive(make_joy(1.0))
    teleop.step(swarm.now_s)
    for _ in range(10):
        teleop.receive(make_joy(1.0))
    use_stick(swarm, teleop, None, 1.0)
    assert {command[1:] for command in sent} == {(0.0, 0.0)}
    use_stick(swarm, teleop, make_joy(1.0), 1.0)
    assert sent[-1][1] > 0.0


def test_a_stop_button_pressed_during_a_pause_of_the_program_counts(swarm):
    teleop = JoystickTeleop(swarm, MAPPING)
    hang(swarm)
    teleop.receive(make_joy(0.0, stop=True))
    assert swarm.drivers.requests == [True]


def test_a_short_press_of_the_stop_button_stops_all_robots_once(swarm):
    teleop = JoystickTeleop(swarm, MAPPING)
    teleop.receive(make_joy(0.0, stop=True))
    teleop.receive(make_joy(0.0, stop=True))
    teleop.receive(make_joy(0.0))
    assert swarm.drivers.requests == [True]


NEXT = 5


def press_next(swarm, teleop):
    use_stick(swarm, teleop, make_joy(1.0, pressed=[NEXT]), 0.2)
    use_stick(swarm, teleop, make_joy(1.0), 0.8)
    return [robot.robot_id for robot in swarm if robot.velocity.linear_m_s > 0.05]


def test_a_button_chooses_one_robot_or_all_and_lights_show_it():
    with StepSwarm(3, perfect=True) as swarm:
        swarm.drivers = Drivers()
        teleop = JoystickTeleop(swarm, MAPPING)
        assert [press_next(swarm, teleop) for _ in range(3)] == [[0], [1], [2]]
        assert [robot.light[:3] == (1.0, 1.0, 1.0) for robot in swarm] == [False, False, True]
        assert press_next(swarm, teleop) == [0, 1, 2]
        assert not any(any(robot.light[:3]) for robot in swarm)
