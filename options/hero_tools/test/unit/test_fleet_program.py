"""The program fleet in virtual time: how long it waits and shows, what keys do, and how it ends."""

import argparse
import contextlib
import io
import json
import math
from types import SimpleNamespace
from unittest.mock import create_autospec

import pytest
from test_fleet_rows import make_row

from hero_client.ros import RobotTrack, StopStatus
from hero_msgs.msg import Robot, RobotArray
from hero_node import Pose, ProgramError
from hero_tools import fleet as module
from hero_tools.fleet import (
    DRAW_PERIOD_S,
    DRIVER_TIMEOUT_S,
    ENTER_SCREEN,
    LEAVE_SCREEN,
    PRINT_PERIOD_S,
    FleetProgram,
    RobotRow,
    take_screen,
)
from hero_tools.fleet_rows import MOVED_M, MOVED_RAD, find_missing
from hero_tools.fleet_table import format_cells, format_nearest, make_row_dict


class World:
    """Drivers, listeners, and a program with its time."""

    def __init__(self, monkeypatch):
        self.now_s, self.reports_s, self.settles_s, self.hears_s = 100.0, 0.0, 0.0, 0.0
        self.robots, self.stopped, self.status, self.requests, self.checked = [(0, Robot.READY)], False, None, [], []
        self.running, self.end_signal, self.listeners, self.closed = True, None, {}, []
        self.request_stop = self.requests.append
        monkeypatch.setattr(module, "Drivers", lambda: self)
        monkeypatch.setattr(module, "RobotListener", self.listen)
        monkeypatch.setattr(
            module, "ThreadPoolExecutor", lambda *given: SimpleNamespace(submit=lambda call, *given: call(*given))
        )
        monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: self.now_s, time=lambda: 1.7e9))
        monkeypatch.setattr(module.shutil, "get_terminal_size", lambda: SimpleNamespace(columns=100, lines=8))

    @property
    def is_settled(self):
        return self.now_s >= 100.0 + self.settles_s

    def find_silent(self):
        return ["/lab/driver"] if self.stopped else []

    def stop_status(self):
        return self.status

    def check_stop(self):
        self.checked.append(True)

    def read(self):
        if self.now_s < 100.0 + self.reports_s:
            return None
        rows = [Robot(id=number, namespace="/hero_%d" % number, state=state) for number, state in self.robots]
        return RobotArray(robots=rows, stopped=self.stopped, listening="10.42.0.1:11411")

    def listen(self, namespace):
        listener = self.listeners[namespace] = SimpleNamespace(
            track=RobotTrack(), values={}, close=lambda: self.closed.append(namespace)
        )

        def read_newest():
            if self.now_s >= 100.0 + self.hears_s:
                listener.track.receive_pose(Pose(self.now_s - 100.0, 0.0, 0.0))
                listener.track.receive_proximity([0.1])

        listener.read_newest = read_newest
        return listener

    def sleep(self, duration_s):
        assert self.now_s < 1000.0, "it goes on without end"
        self.now_s += max(duration_s, 1e-3)
        return self.running

    def start(self, **options):
        given = {"seconds": None, "expect": None, "json": False, "once": False, "inventory": None, **options}
        return FleetProgram(self, argparse.Namespace(**given))

    def wait_readable(self, files, timeout_s):
        self.now_s += timeout_s
        return bool(self.keys)


@pytest.fixture(name="world")
def make_world(monkeypatch):
    return World(monkeypatch)


def test_once_waits_for_drivers_and_then_for_what_robots_send(world, capsys):
    for hears_s, ends_s in ((0.0, 1.5), (3.0, 3.0), (99.0, 5.0)):
        world.now_s, world.reports_s, world.settles_s, world.hears_s = 100.0, 2.0, 4.0, 4.0 + hears_s
        assert world.start(once=True).run_once() == 0
        assert world.now_s == pytest.approx(104.0 + ends_s, abs=0.25)
    assert "1 of 1 robots ready" in capsys.readouterr().out
    world.now_s, world.reports_s = 100.0, 99.0
    assert world.start(once=True).run_once() == 1
    assert world.now_s == pytest.approx(100.0 + DRIVER_TIMEOUT_S, abs=0.05)
    assert "no driver: nothing on /hero_driver/robots after 10 s" in capsys.readouterr().err
    world.running = False
    assert world.start(once=True).run_once() == 1 and capsys.readouterr().err == ""


def test_without_a_terminal_lines_come_now_and_then_and_at_the_end(world, capsys):
    assert world.start(json=True, seconds=12.0).run_lines() == 0
    lines = capsys.readouterr().out.splitlines()
    assert world.now_s == pytest.approx(112.0, abs=0.01) and len(lines) == int(12.0 / PRINT_PERIOD_S) + 1
    assert json.loads(lines[-1])["robots"][0]["id"] == 0
    world.now_s, world.robots = 100.0, [(0, Robot.READY), (1, Robot.AWAY)]
    assert world.start(json=True, seconds=1.0, expect=2).run_lines() == 1
    assert capsys.readouterr().err == "fleet: hero_1 is AWAY\n"
    world.now_s = 100.0
    assert world.start(json=True, seconds=1.0, expect=1).run_lines() == 0
    assert "all 1 robots joined and moved" in capsys.readouterr().out


def test_robots_are_listened_to_while_they_are_there_and_not_refused(world):
    program = world.start()
    world.robots = [(0, Robot.READY), (1, Robot.REFUSED), (2, Robot.AWAY)]
    program._read()
    assert set(world.listeners) == {"/hero_0", "/hero_2"}
    world.robots = [(2, Robot.READY), (1, Robot.REFUSED)]
    program._read()
    assert world.closed == ["/hero_0"] and set(program._listeners) == {"/hero_2"}
    refused = next(row for row in program._rows if row.robot.id == 1)
    assert refused.track.pose is None and not refused.is_heard
    world.reports_s = math.inf
    program._read()
    assert sorted(row.robot.id for row in program._rows) == [1, 2], "as they were last known"
    assert program._make_lines(100, 20)[0] != world.start()._make_lines(100, 20)[0], "no driver yet"


class Keyboard:
    """Keys of a world."""

    def __init__(self, world):
        self.read_keys = lambda: world.keys.pop(0)
        self.fileno = lambda: 0

    def __enter__(self):
        return self

    def __exit__(self, *error):
        pass


def run_screen(world, monkeypatch, reads, **options):
    """Run with a terminal in which these keys are read; return what was drawn."""
    drawn, world.keys = [], list(reads)
    monkeypatch.setattr(module.sys.stdout, "write", drawn.append)
    return world.start(**options).run_screen(Keyboard(world)), "".join(drawn)


def test_keys_stop_release_and_quit(world, monkeypatch):
    code, text = run_screen(world, monkeypatch, [["\r", "s", "r"], ["x"], ["q"], ["\r"]])
    assert code == 0 and world.requests == [True, True, False] and world.checked == [True]
    assert world.now_s == pytest.approx(100.0 + 3.0 * DRAW_PERIOD_S)
    assert text.startswith(module.ENTER_SCREEN) and module.LEAVE_SCREEN in text
    code, text = run_screen(world, monkeypatch, [None])
    assert code == 0 and "1 of 1 robots ready" in text.partition(module.LEAVE_SCREEN)[2], "left on the terminal"


def test_a_stop_is_drawn_at_once_and_a_time_limit_counted_down(world, monkeypatch):
    world.status, world.stopped = StopStatus("error", "NOT STOPPED: hero_0 moves", False), True
    _, text = run_screen(world, monkeypatch, [["x"], ["q"]], seconds=30.0)
    assert world.now_s == pytest.approx(100.2) and "NOT STOPPED: hero_0 moves" in text
    assert "ALL STOPPED before the driver's start, driver lab/driver does not answer" in text
    _, text = run_screen(world, monkeypatch, [], seconds=1.2)
    assert "ends in 1 s" in text and world.now_s == pytest.approx(101.4, abs=0.01)
    world.checked.clear()
    monkeypatch.setattr(world, "end_signal", 15)
    _, text = run_screen(world, monkeypatch, [["q"]])
    assert text.endswith(module.LEAVE_SCREEN) and world.checked == [True]


def test_a_program_that_leaves_robots_driving_ends_with_an_error(world, monkeypatch):
    program = world.start()

    def fail():
        raise ProgramError("NOT STOPPED: hero_0 moves")

    program._drivers.check_stop = fail
    world.keys = [["q"]]
    with pytest.raises(ProgramError):
        program.run_screen(Keyboard(world))


@pytest.mark.parametrize(
    ("arguments", "is_terminal", "has_keys", "expected"),
    [
        (["--once"], True, True, "once"),
        (["--inventory"], True, True, "once"),
        (["--json"], True, True, "lines"),
        ([], False, True, "lines"),
        ([], True, False, "lines"),
        ([], True, True, "screen"),
    ],
)
def test_what_is_shown_fits_the_output_and_a_signal_is_the_status(
    world, monkeypatch, arguments, is_terminal, has_keys, expected
):
    shown, keyboard = [], Keyboard(world)

    def open_keyboard():
        if not has_keys:
            raise module.NoTerminalError("no terminal")
        return keyboard

    for name in ("once", "lines", "screen"):
        show = create_autospec(getattr(FleetProgram, "run_" + name))
        show.side_effect = lambda own, *given, name=name: shown.append((name, *given)) or 1
        monkeypatch.setattr(FleetProgram, "run_" + name, show)
    monkeypatch.setattr(module, "Program", lambda name, anonymous: contextlib.nullcontext(world))
    monkeypatch.setattr(module, "Keyboard", open_keyboard)
    monkeypatch.setattr(module.rospy, "myargv", lambda: ["fleet", *arguments])
    monkeypatch.setattr(module.sys.stdout, "isatty", lambda: is_terminal, raising=False)
    assert module.main() == 1
    world.end_signal = 15
    assert module.main() == 143, "whatever is missing"
    assert shown == [(expected, keyboard) if expected == "screen" else (expected,)] * 2


def test_a_robot_has_moved_from_half_its_body_or_a_radian_on():
    for distance_m, turned_rad, has_moved in ((MOVED_M, 0.0, True), (0.049, 0.99, False), (0.0, MOVED_RAD, True)):
        row = make_row(0, distance_m=distance_m, turned_rad=turned_rad)
        assert row.moved == has_moved == make_row_dict(row)["moved"] == (find_missing([row], [0]) == {})
    away = make_row(0, state=Robot.AWAY)
    assert find_missing([away], [0]) == {0: "is AWAY"}, "without an error"
    assert find_missing([make_row(0, namespace="")], [0]) == {0: "did not join"}


def test_cells_have_units_and_the_table_its_words():
    row = make_row(0, distance_m=1.234, reconnects=2, last_error="late", stop_state=Robot.AT_REST)
    row.track.pose = Pose(1.0, -2.0, 3.141592)
    cells = format_cells(row)
    assert cells[2:8] == ["READY, at rest", "29.3 Hz", "44.1 kB/s", "  1.00  -2.00 m  180 deg", "1.23 m", "free"]
    assert cells[8] == "late; reconnected 2x" and format_cells(make_row(0))[8] == ""
    for eighth, words in enumerate(
        ("front", "front left", "left", "rear left", "rear", "rear right", "right", "front right")
    ):
        nearest = SimpleNamespace(range_m=0.1, bearing_rad=eighth * 0.7854 + 0.3)
        assert format_nearest(True, False, nearest) == "0.10 m " + words
    stopped = format_cells(row._replace(stopped=True))
    assert stopped[2] == "STOPPED, at rest"
    away = format_cells(make_row(0, state=Robot.AWAY))
    assert (away[2], away[3], away[4], away[7]) == ("AWAY", "-", "-", "-"), "what it said is not what it is"
    shown = make_row_dict(RobotRow(row.robot, row.track, 29.3456))
    assert (shown["odom_hz"], shown["bytes_per_s"], shown["distance_m"], shown["nearest"]) == (
        29.35,
        44051.0,
        1.234,
        None,
    )


def test_the_table_is_as_high_as_the_terminal_and_leaves_robots_out(world):
    world.robots = [(number, Robot.READY) for number in range(30)]
    program = world.start()
    program._read()
    for height in (8, 20):
        assert len(program._make_lines(100, height)) == height
    assert len(program._make_lines(100, 10000)) > 30
    assert len(program._make_screen(None)) == 8, "with the state of a stop and the keys"


def test_all_lines_are_drawn_over_the_earlier_ones_in_one_piece(monkeypatch):
    calls = []
    stdout = SimpleNamespace(write=calls.append, flush=lambda: calls.append("flush"))
    monkeypatch.setattr(module.sys, "stdout", stdout)
    module.draw(["first", "last"])
    assert calls == ["\x1b[Hfirst\x1b[K\r\nlast\x1b[K\x1b[J", "flush"]


class Terminal(io.StringIO):
    """An output, which may be closed meanwhile."""

    is_closed = False

    def write(self, text):
        if self.is_closed:
            raise OSError("Input/output error")
        return super().write(text)


@pytest.mark.parametrize("is_closed", [False, True])
@pytest.mark.parametrize("error", [None, KeyboardInterrupt, ArithmeticError])
def test_the_terminal_gets_its_screen_and_keys_back_whatever_happens(monkeypatch, error, is_closed):
    terminal, steps = Terminal(), []

    @contextlib.contextmanager
    def read_keys():
        try:
            yield
        finally:
            steps.append("keys are given back")

    monkeypatch.setattr(module.sys, "stdout", terminal)
    with pytest.raises(error) if error else contextlib.nullcontext(), take_screen(read_keys()):
        terminal.is_closed = is_closed
        if error:
            raise error
    assert terminal.getvalue() == ENTER_SCREEN + ("" if is_closed else LEAVE_SCREEN)
    assert steps == ["keys are given back"]
