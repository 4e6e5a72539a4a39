"""Keyboard and joystick with robots in virtual time: what is sent, when, and to which robots."""

import math
from types import SimpleNamespace

import pytest
from linkless_robot import FakeSwarm

pytest.importorskip("rospy", reason="teleoperation is made for ROS programs")
from sensor_msgs.msg import Joy

from hero_client.apps import joystick_teleop, keyboard_teleop
from hero_client.apps.joystick_teleop import (
    DRAIN_S,
    FIRST_WARNING_S,
    SILENCE_S,
    JoystickMapping,
    JoystickTeleop,
)
from hero_client.apps.keyboard_teleop import PERIOD_S, KeyboardTeleop
from hero_client.apps.teleop_output import HOLD_ENDED, PAUSE_S, TeleopOutput
from hero_client.ros.stop_status import StopStatus
from hero_msgs.msg import RobotArray
from hero_node import ProgramError

MAPPING = JoystickMapping(0.1, 2.0, 1, 0, 4, 1)


class FakeDrivers:
    """Notes requests; its status is what a test says."""

    def __init__(self):
        self.requests, self.status = [], None

    def request_stop(self, stopped):
        self.requests.append(stopped)

    def stop_status(self):
        return self.status

    def read(self):
        return RobotArray(stopped=True, stopped_by="/hero_monitor")


def make_swarm(*numbers):
    swarm = FakeSwarm(*numbers)
    swarm.drivers = FakeDrivers()
    return swarm


def velocities(link):
    """Return and forget what was sent."""
    sent = [tuple(velocity) for _, *velocity in link.sent]
    link.sent.clear()
    return sent


@pytest.fixture(name="shown")
def note_shown(monkeypatch):
    shown = []
    monkeypatch.setattr(keyboard_teleop, "show_text", shown.append)
    for name in ("loginfo", "logwarn", "logerr", "logwarn_once"):
        monkeypatch.setattr(joystick_teleop.rospy, name, lambda *said, name=name: shown.append((name, said[0])))
    return shown


def test_every_motion_and_one_stop_pass():
    output = TeleopOutput(pytest.fail)
    moves = [(0.0, 0.0), (0.1, 0.0), (0.1, 0.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.1), (0.0, 0.0), (0.0, 0.0)]
    assert [output.passes(move) for move in moves] == [False, True, True, True, False, True, True, False]


def test_keys_are_sent_at_once_and_then_ten_times_a_second(shown):
    swarm = make_swarm(0, 1)
    teleop = KeyboardTeleop(swarm, 0.1, 1.0)
    teleop.step(0.0)
    assert velocities(swarm.links[0]) == []
    teleop.press("w", 0.02)
    for now_s in (0.02, 0.05, 0.119, 0.02 + PERIOD_S):
        teleop.step(now_s)
    assert velocities(swarm.links[0]) == [(0.1, 0.0)] * 2
    teleop.press("s", 0.13)
    for now_s in (0.13, 0.25, 0.5):
        teleop.step(now_s)
    assert velocities(swarm.links[0]) == [(0.0, 0.0)], "then other programs may drive it"
    assert swarm.links[1].sent == [] == shown


def test_a_stop_key_stops_a_robot_that_another_program_drives(shown):
    swarm = make_swarm(0)
    teleop = KeyboardTeleop(swarm, 0.1, 1.0)
    teleop.step(0.0)
    teleop.press("s", 0.01)
    teleop.step(0.01)
    assert velocities(swarm.links[0]) == [(0.0, 0.0)], "at once"
    for now_s in (0.02, 0.2):
        teleop.step(now_s)
    assert velocities(swarm.links[0]) == []


def test_keys_choose_robots_and_those_that_were_driven_stop(shown):
    swarm = make_swarm(0, 4, 2)
    teleop = KeyboardTeleop(swarm, 0.1, 1.0)
    for key, chosen, stopped in (
        ("\t", [4], [0]),
        ("\t", [2], [4]),
        ("\t", [0], [2]),
        ("4", [4], [0]),
        ("g", [0, 4, 2], [4]),
        ("\t", [0], [0, 4, 2]),
        ("7", [0], []),
    ):
        teleop.press(key, 0.0)
        assert [robot.robot_id for robot in teleop._chosen] == chosen
        assert [robot.robot_id for robot, link in zip(swarm, swarm.links) if velocities(link)] == stopped
    assert shown == ["hero_7 is not in this swarm: hero_0, hero_4, hero_2\n"]
    teleop.press("g", 0.0)
    teleop.press("w", 0.0)
    teleop.press("2", 0.1)
    for link in swarm.links:
        velocities(link)
    teleop.step(0.2)
    assert not any(map(velocities, swarm.links)), "the key drove the others"


def test_keys_stop_and_release_all_robots(shown):
    swarm = make_swarm(0, 1)
    teleop = KeyboardTeleop(swarm, 0.1, 1.0)
    teleop.press("w", 0.0)
    teleop.step(0.0)
    teleop.press("\r", 0.1)
    teleop.press("r", 0.2)
    assert swarm.drivers.requests == [True, False]
    teleop.step(0.2)
    assert velocities(swarm.links[0])[-1] == (0.0, 0.0)
    swarm.links[0].is_stopped = True
    teleop.step(0.96)
    for now_s in (1.0, 2.0):
        teleop.press("w", now_s)
        teleop.step(now_s)
        teleop.step(now_s + 0.8)
    assert velocities(swarm.links[0]) == [] and shown == [
        "all robots are stopped by hero_monitor, so hero_0 cannot move: r releases them\n"
    ]
    swarm.links[0].is_stopped = False
    teleop.step(2.9)
    teleop.press("w", 3.0)
    teleop.step(3.0)
    assert velocities(swarm.links[0]) == [(0.1, 0.0)]
    teleop.step(3.8)
    swarm.links[0].is_stopped = True
    teleop.step(3.9)
    teleop.press("a", 4.0)
    teleop.step(4.0)
    assert len(shown) == 2, "said again after it was released"


@pytest.mark.parametrize("other", [0, 1])
def test_a_key_that_repeats_through_a_stop_drives_after_a_new_press(shown, other):
    swarm = make_swarm(0, 1)
    teleop = KeyboardTeleop(swarm, 0.1, 1.0)

    def hold(start_s, end_s):
        for step in range(round((end_s - start_s) / 0.05)):
            teleop.press("w", start_s + 0.05 * step)
            teleop.step(start_s + 0.05 * step)
        return velocities(swarm.links[0])

    assert (0.1, 0.0) in hold(0.0, 1.0)
    swarm.links[other].is_stopped = True
    hold(1.0, 3.0)
    assert shown == [HOLD_ENDED + "\n"]
    swarm.links[other].is_stopped = False
    assert (0.1, 0.0) not in hold(3.0, 5.0)
    assert shown == [HOLD_ENDED + "\n"] * 2, "once for the stop, once for the release"
    for now_s in (5.2, 5.3):
        teleop.step(now_s)
    assert hold(5.4, 6.0)[0] == (0.1, 0.0) and len(shown) == 2
    for now_s in (6.5, 7.0, 7.5):  # let go
        swarm.links[other].is_stopped = now_s > 6.5
        teleop.step(now_s)
    velocities(swarm.links[0])
    hold(8.0, 9.0)
    swarm.links[other].is_stopped = False
    assert (0.1, 0.0) not in hold(9.0, 10.0), "a key that is held at the release was pressed before"


def test_the_live_line_tells_the_robot_or_what_keeps_it_from_driving():
    swarm = make_swarm(3, 1)
    teleop = KeyboardTeleop(swarm, 0.1, 1.0)
    assert teleop.describe() == (
        "info",
        "hero_3 | +0.00 m/s +0.00 rad/s (keys: 0.10, 1.00) | x 0.00 y 0.00 m 0 deg | near: free",
    )
    swarm.links[0].ranges[2] = 0.15
    assert teleop.describe()[1].endswith("near: 0.15 m at +90 deg")
    swarm.links[0].silent_s["odom"] = 1.2
    assert "hero_3 | waiting: the last message on /hero_3/odom came 1.2 s ago" in teleop.describe()[1]
    swarm.links[0].ready_s += 1.0
    assert teleop.describe() == ("info", "hero_3 | waiting: nothing subscribes")
    teleop.press("g", 0.0)
    assert teleop.describe()[1].startswith("all 2 robots | waiting")
    for status, stopped, expected in (
        (StopStatus("warn", "stopping", False), False, ("warn", "all 2 robots | stopping")),
        (
            StopStatus("info", "stopped, all wheels at rest", True),
            True,
            ("info", "stopped, all wheels at rest: r releases them"),
        ),
        (StopStatus("info", "released", True), False, ("info", "waiting: nothing subscribes")),
        (StopStatus("error", "NOT RELEASED", True), False, ("error", "NOT RELEASED")),
        (StopStatus("error", "NOT STOPPED", False), True, ("error", "NOT STOPPED")),
        (None, True, ("warn", "all robots are stopped by hero_monitor, so hero_1 cannot move")),
    ):
        swarm.drivers.status, swarm.links[1].is_stopped = status, stopped
        level, text = teleop.describe()
        assert level == expected[0] and expected[1] in text


def test_a_joystick_drives_only_while_enabled_and_finite(shown):
    def read(axes, pressed=(4,), buttons=6):
        return MAPPING.read(Joy(axes=axes, buttons=[int(index in pressed) for index in range(buttons)]))

    assert read([0.5, -1.0]) == (-0.1, 1.0)
    assert read([0.5, -1.0], ()) == (0.0, 0.0) and not shown
    assert read([0.5, math.nan]) == read([math.inf, 0.0]) == (0.0, 0.0)
    assert {name for name, _ in shown} == {"logwarn_once"} and "are not finite: the robot is stopped" in shown[0][1]
    for axes, buttons in (([0.5], 6), ([0.5, 1.0], 4)):
        with pytest.raises(ProgramError, match="the joystick has %d axes and %d buttons" % (len(axes), buttons)):
            read(axes, buttons=buttons)
    read([0.5, 1.0], buttons=5)
    with pytest.raises(ProgramError):
        MAPPING._replace(linear_axis=0, angular_axis=2).read(Joy(axes=[0.5, 1.0], buttons=[1] * 6))


def push(teleop, *pressed, stick=1.0):
    teleop.receive(Joy(axes=[0.0, stick], buttons=[int(index in pressed) for index in range(6)]))


def test_a_joystick_needs_the_axes_and_buttons_that_are_read_and_no_more():
    assert MAPPING.read(Joy(axes=[0.5, 1.0], buttons=[0, 0, 0, 0, 1])) == (0.1, 1.0)
    for axes, buttons in (([0.5], [0] * 5), ([0.5, 1.0], [0] * 4)):
        with pytest.raises(ProgramError, match="the joystick has %d axes and %d buttons" % (len(axes), len(buttons))):
            MAPPING.read(Joy(axes=axes, buttons=buttons))


def test_a_joystick_that_falls_silent_stops_the_robots(shown):
    swarm = make_swarm(0, 1)
    teleop = JoystickTeleop(swarm, MAPPING)
    push(teleop, 4)
    for _ in range(12):
        swarm.sleep(0.1)
        teleop.step(swarm.now_s)
    moved_s = [sent[0] for sent in swarm.links[0].sent if sent[1]]
    assert max(moved_s) == pytest.approx(SILENCE_S - 0.1, abs=0.11)
    for link in swarm.links:
        assert velocities(link)[-2:] == [(0.1, 0.0), (0.0, 0.0)]
    swarm.links[1].ready_s = math.inf
    for _ in range(120):
        swarm.sleep(0.1)
        teleop.step(swarm.now_s)
    assert "hero_1: waiting: nothing subscribes" in swarm.logged[0]
    assert not velocities(swarm.links[0]) and [level for level, _ in shown] == ["logwarn"] * 3, "every 5 s from 2 s on"


def test_a_joystick_is_silent_told_and_heard_again_from_its_times_on(shown):
    assert not joystick_teleop.is_held([1] * 5, 5) and joystick_teleop.is_held([0, 1], 1), "one that it lacks"
    swarm = make_swarm(0)
    start_s, clock = swarm.now_s, swarm._clock
    teleop = JoystickTeleop(swarm, MAPPING)
    for after_s, warnings in ((FIRST_WARNING_S - 0.125, 0), (FIRST_WARNING_S, 1)):
        teleop._pauses.step(start_s + after_s)
        teleop.step(start_s + after_s)
        assert len(shown) == warnings
    push(teleop, 4)
    arrived_s = teleop._arrival_s
    for after_s, command in ((SILENCE_S - 0.125, (0.1, 0.0)), (SILENCE_S, (0.0, 0.0))):
        teleop.step(arrived_s + after_s)
        assert velocities(swarm.links[0])[-1] == command
    teleop._fresh_s = clock.now_s = arrived_s + 0.25
    teleop._pauses.step(clock.now_s)
    push(teleop, 4)
    assert teleop._arrival_s == clock.now_s


def test_what_waited_during_a_pause_drives_no_robot(shown):
    swarm = make_swarm(0)
    teleop = JoystickTeleop(swarm, MAPPING)
    teleop.step(swarm.now_s)
    swarm.sleep(PAUSE_S + 0.1)
    push(teleop, 4)  # on rospy's thread, before the program's next step
    teleop.step(swarm.now_s)
    push(teleop, 4)
    swarm.sleep(DRAIN_S - 0.1)
    push(teleop, 4)
    teleop.step(swarm.now_s)
    assert velocities(swarm.links[0]) == []
    swarm.sleep(0.11)
    push(teleop, 4)
    teleop.step(swarm.now_s)
    assert velocities(swarm.links[0]) == [(0.1, 0.0)]


def test_an_enable_button_held_through_a_stop_drives_after_a_new_press(shown):
    swarm = make_swarm(0, 1)
    teleop = JoystickTeleop(swarm, MAPPING)

    def use(*messages):
        """Receive messages of these pressed buttons and stick positions, step, and return what was sent."""
        for pressed, stick in messages:
            push(teleop, *pressed, stick=stick)
        teleop.step(swarm.now_s)
        swarm.sleep(0.1)
        return velocities(swarm.links[0])

    held, released = ((4,), 1.0), ((), 1.0)
    assert use(held) == [(0.1, 0.0)]
    swarm.links[1].is_stopped = True
    assert use(held) == [(0.0, 0.0)] and use(held) == []
    swarm.links[1].is_stopped = False
    assert use(held) == [] == use(((4,), 0.0)) == use(held), "a stick in its middle is no release of the button"
    assert [said for said in shown if said[0] == "logwarn"] == [("logwarn", HOLD_ENDED)] * 2
    assert use() == [] == use(released) and use(held) == [(0.1, 0.0)]
    swarm.links[0].is_stopped = True
    assert use(released, held) == [(0.0, 0.0)], "which came first is not known"
    swarm.links[0].is_stopped = False
    assert use(held) == [] and use(released, held) == [(0.1, 0.0)], "a short release"
    for is_stopped in (True, False):
        use(released)
        swarm.links[0].is_stopped = is_stopped
        use()
    assert use(held) == [(0.1, 0.0)], "nothing was held through these"


def test_a_press_of_the_stop_button_stops_all_once_even_after_a_pause(shown):
    swarm = make_swarm(0)
    teleop = JoystickTeleop(swarm, MAPPING)
    swarm.sleep(2.0 * PAUSE_S)
    for pressed in ((1,), (1, 4), (), (1,)):
        push(teleop, *pressed)
    teleop.receive(Joy(axes=[], buttons=[]))
    assert swarm.drivers.requests == [True, True]
    for status, level in (
        (None, None),
        (StopStatus("warn", "stopping", False), "logwarn"),
        (StopStatus("error", "NOT STOPPED", False), "logerr"),
        (StopStatus("info", "stopped", True), "loginfo"),
    ):
        shown.clear()
        swarm.drivers.status = status
        for _ in range(2):
            teleop.step(swarm.now_s)
        assert [said for said in shown if "joy" not in said[1]] == ([(level, status.text)] if status else [])


def test_buttons_choose_robots_and_those_that_are_left_stop(shown):
    swarm = make_swarm(4, 1, 9)
    teleop = JoystickTeleop(swarm, MAPPING)
    push(teleop, 5, 4)
    push(teleop, 4)
    teleop.step(swarm.now_s)
    assert [velocities(link) for link in swarm.links] == [[(0.1, 0.0)], [(0.0, 0.0)], [(0.0, 0.0)]]
    assert [link.colors[-1][1] for link in swarm.links] == [(1.0, 1.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)]


@pytest.mark.parametrize("numbers", [(0, 1, 2), (4,)])
def test_a_button_chooses_one_robot_after_the_other_and_all_again(shown, numbers):
    swarm = make_swarm(*numbers)
    teleop = JoystickTeleop(swarm, MAPPING)
    rounds = [[number] for number in numbers] if len(numbers) > 1 else []
    for chosen in [*rounds, list(numbers), *rounds]:
        for is_held in (1, 1, 0):  # a press counts once, however long it is held
            swarm.sleep(0.1)
            teleop.receive(Joy(axes=[0.0, 1.0], buttons=[0, 0, 0, 0, 1, is_held]))
            teleop.step(swarm.now_s)
        driven = [number for number, link in zip(numbers, swarm.links) if velocities(link)[-1:] == [(0.1, 0.0)]]
        assert driven == chosen
        lit = [number for number, link in zip(numbers, swarm.links) if link.colors[-1][1] == (1.0, 1.0, 1.0)]
        assert lit == (chosen if len(numbers) > 1 and len(chosen) == 1 else [])
    assert MAPPING[6:] == (5,), "as the documents say"


def test_a_joystick_is_heard_until_the_end_and_its_stop_checked(monkeypatch):
    swarm, steps = make_swarm(0), []

    def subscribe(topic, kind, receive, queue_size, tcp_nodelay):
        assert (topic, kind, tcp_nodelay) == ("/joy", Joy, True) and queue_size > 1
        steps.append(receive)

    def rate(hz):
        assert hz == 10.0
        for _ in range(3):
            steps.append("turn")
            steps[0](Joy(axes=[0.0, 1.0], buttons=[0, 1, 0, 0, 1, 0]))
            yield

    monkeypatch.setattr(joystick_teleop.rospy, "Subscriber", subscribe)
    swarm.drivers.check_stop = lambda: steps.append("checked")
    JoystickTeleop(swarm, MAPPING).run(SimpleNamespace(rate=rate))
    assert steps[1:] == ["turn", "turn", "turn", "checked"] and swarm.drivers.requests == [True]


def test_a_program_with_a_keyboard_ends_and_reads_as_it_should(shown, monkeypatch):
    monkeypatch.setattr(keyboard_teleop, "show_live_line", lambda *line: None)
    swarm = make_swarm(0)
    swarm.drivers.check_stop = lambda: shown.append("checked")

    class Program:
        """Readable in each round; pauses_s: how long it stands still in which round."""

        running = True

        def __init__(self, pauses_s=None):
            self.now_s, self._pauses_s, self._rounds = 0.0, pauses_s or {}, 0

        def wait_readable(self, files, timeout_s):
            self.now_s += timeout_s + self._pauses_s.get(self._rounds, 0.0)
            self._rounds += 1
            return True

    def run(reads, pauses_s=None):
        keyboard = SimpleNamespace(fileno=lambda: 0, read_keys=lambda: reads.pop(0) if reads else None)
        KeyboardTeleop(swarm, 0.1, 1.0).run(Program(pauses_s), keyboard)
        return velocities(swarm.links[0])

    assert (0.1, 0.0) in run([["w"], ["w"], []])
    assert run([["\x04", "w"], ["w"]]) == [] and shown[-1] == "checked"
    assert run([[], ["w"], [], []], {1: 2.0 * PAUSE_S}) == [], "typed while it stood still"
    assert (0.0, 1.0) in run([[], ["w"], [], ["a"], []], {1: 2.0 * PAUSE_S}), "typed after it"
