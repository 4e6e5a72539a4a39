"""Which programs pages may start, with what, and how they end: with the monitor, by a stop, or by themselves."""

import contextlib
import errno
import importlib.util
import io
import json
import os
import queue
import select
import signal
import subprocess
import sys
import threading
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock, create_autospec

import pytest
import roslib.packages
import rospkg
import yaml

import sources
from hero_monitor.control import programs as programs_module
from hero_monitor.control.offers import OFFERS, check_values, describe_offers, make_arguments, place_robots
from hero_monitor.control.programs import ChildProcess, Programs
from hero_monitor.control.requests import RequestError
from hero_node.files import EntryError
from hero_swarm.behaviors import list_names
from hero_test.waiting import wait_for

DEADLINE_S = 300.0
BEAT_S = 0.1

CIRCLE = {"shape": "circle", "spacing_m": 0.3, "turn_deg": 90.0, "x_m": 1.0, "y_m": -0.5, "linear_m_s": 0.08}

# Two programs write into one pipe: unbuffered, print() would write the end of a line apart.
OBEDIENT = (
    "import os, signal; signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT]);"
    r"os.write(1, b'runs\n'); signal.sigwait([signal.SIGINT]); print('robots are stopped')"
)
DEAF = "import signal, time; signal.signal(signal.SIGINT, signal.SIG_IGN); print('deaf', flush=True); time.sleep(900)"


@pytest.mark.parametrize(
    ("printed", "line"),
    [(b"", ""), (b"x", "x"), (b"first\nlast\x07 one \n\n", "last? one"), (b"x" * 1999 + b"\n", "x" * 1999)],
)
def test_the_last_line_of_a_program_tells_why_it_failed(printed, line):
    assert programs_module.read_last_line(io.BytesIO(printed)) == line
    assert programs_module.read_last_line(io.BytesIO(b"y" * 9000 + b"\n" + printed)) in (line, "y" * 1999)


def test_a_folder_that_is_not_there_yet_holds_nothing(tmp_path):
    assert programs_module.measure(tmp_path / "none") == 0
    for name in ("hero_0.bag", "hero_1.bag.active"):
        (tmp_path / name).write_bytes(b"x" * 7)
    assert programs_module.measure(tmp_path) == 14


def read_launch_arguments(package, program):
    text = (sources.PACKAGES[package] / "launch" / (program + ".launch")).read_text(encoding="utf-8")
    return [line.split('name="')[1].split('"')[0] for line in text.splitlines() if "<arg " in line]


@pytest.mark.parametrize("program", OFFERS)
def test_all_that_pages_may_set_are_parameters_of_the_program(program):
    offer = OFFERS[program]
    defaults = {name: field.default for name, field in offer.fields.items()}
    check_values(program, defaults)
    arguments = dict(text[1:].split(":=", 1) for text in make_arguments(program, [0, 12], "map", defaults))
    assert set(arguments) <= set(read_launch_arguments(offer.package, offer.program))
    assert yaml.safe_load(arguments["robots"]) == "0 12"
    needs_frame = program in ("swarm_go_to", "follow") or program.startswith("behavior_")
    assert ("frame" in arguments) == offer.has_frame == needs_frame


def test_all_built_in_behaviors_are_offered():
    (segregation,) = describe_offers(["behavior_segregation"])
    assert segregation["sentence"] == OFFERS["behavior_segregation"].sentence != ""
    assert [name for name in OFFERS if name.startswith("behavior_")] == ["behavior_" + name for name in list_names()]


OWN = """
from hero_node.parameters import number
from hero_swarm import Behavior

class Dance(Behavior):
    swing_m = 0.3
    settings = {"swing_m": number(0.3, 0.1, 1.0, "m")}
"""


def test_behaviors_are_described_by_a_process_that_may_fail(monkeypatch, capfd):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "hero_swarm" else "found")
    run = create_autospec(subprocess.run)
    monkeypatch.setattr(programs_module.subprocess, "run", run)
    assert programs_module.find_behaviors("~/own") == {} and not run.called
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: "found")
    described = {"behavior": "own.py:Dance", "title": "Dance", "sentence": "It dances.", "fields": []}
    run.return_value = subprocess.CompletedProcess([], 0, json.dumps([described]).encode())
    (offer,) = programs_module.find_behaviors("~/own").items()
    assert offer[0] == "behavior_own.py:Dance" and offer[1][:3] == ("hero_swarm", "behavior", "Dance")
    assert (offer[1].behavior, offer[1].sentence, offer[1].has_frame) == ("own.py:Dance", "It dances.", True)
    command = [sys.executable, "-m", "hero_swarm", "describe", os.path.expanduser("~/own")]
    run.assert_called_once_with(command, stdout=subprocess.PIPE, timeout=60.0, check=True)
    for error in (subprocess.TimeoutExpired("python3", 60.0), OSError(12, "Cannot allocate memory"), ValueError("x")):
        run.side_effect = error
        assert programs_module.find_behaviors("~") == {}
        assert f"no behaviors are offered: {error}" in capfd.readouterr().err


def test_only_programs_of_installed_packages_are_offered(monkeypatch):
    def find(package, program):
        if package == "hero_swarm":
            raise rospkg.ResourceNotFound(package)
        return {"record": ["/opt/record"], "follow": ["/opt/follow", "/old/follow"], "led_show": None}.get(program, [])

    monkeypatch.setattr(roslib.packages, "find_node", find)
    monkeypatch.setattr(roslib.packages, "ROSPkgException", rospkg.ResourceNotFound)
    assert programs_module.find_programs() == {"record": "/opt/record", "follow": "/opt/follow"}
    monkeypatch.setattr(roslib.packages, "find_node", lambda package, program: [f"/{package}/{program}"])
    found = programs_module.find_programs()
    assert found["behavior_milling"] == found["behavior_rendezvous"] == "/hero_swarm/behavior"
    assert set(found) == {*OFFERS, "record"}


@pytest.mark.slow
def test_behaviors_of_users_are_offered_and_a_broken_file_is_left_out(tmp_path, capfd):
    (tmp_path / "dance.py").write_text(OWN)
    (tmp_path / "broken.py").write_text("import nothing_of_this_name")
    (tmp_path / "two.py").write_text(OWN + "class Rest(Behavior):\n    pass\n")
    found = programs_module.find_behaviors(str(tmp_path))
    own = {name: offer for name, offer in found.items() if name not in OFFERS}
    assert [offer.title for offer in own.values()] == ["dance", "Dance", "Rest"]
    dance = next(iter(own.values()))
    assert dance.behavior == f"{tmp_path}/dance.py:Dance"
    assert (dance.fields["swing_m"].default, dance.fields["swing_m"].limits) == (0.3, (0.1, 1.0))
    assert "broken.py, line 1: ModuleNotFoundError" in capfd.readouterr().err


def test_numbers_of_a_behavior_are_one_parameter_of_its_program():
    values = {"groups": 3, "own_m": 0.2, "others_m": 1.0, "max_linear_m_s": 0.05, "safety": "off"}
    check_values("behavior_segregation", values)
    arguments = dict(text[1:].split(":=", 1) for text in make_arguments("behavior_segregation", [1], "map", values))
    assert yaml.safe_load(arguments["parameters"]) == {key: values[key] for key in values if key != "safety"}
    assert (arguments["behavior"], arguments["safety"]) == ('"segregation"', '"off"')


def test_a_formation_is_placed_where_the_map_was_clicked():
    arguments = dict(text[1:].split(":=", 1) for text in make_arguments("swarm_go_to", [0], "map", CIRCLE))
    assert {name: yaml.safe_load(value) for name, value in arguments.items()} == {
        "robots": "0",
        "formation": {"shape": "circle", "spacing_m": 0.3, "turn_deg": 90.0, "center": [1.0, -0.5]},
        "linear_m_s": 0.08,
        "frame": "map",
    }
    (first, second) = place_robots(CIRCLE, 2)
    assert first == pytest.approx((1.0, -0.35))
    assert second == pytest.approx((1.0, -0.65))
    assert place_robots({"linear_m_s": 0.1}, 2) == []
    with pytest.raises(EntryError):
        place_robots({**CIRCLE, "spacing_m": 0.05}, 2)


@pytest.mark.parametrize(
    ("program", "values"),
    [
        ("teleop", {}),
        ("../bin/sh", {}),
        ("random_walk", {}),
        ("random_walk", {"linear_m_s": 0.1, "angular_rad_s": 1.0, "seed": 3}),
        ("random_walk", {"linear_m_s": 0.3, "angular_rad_s": 1.0}),
        ("random_walk", {"linear_m_s": True, "angular_rad_s": 1.0}),
        ("random_walk", {"linear_m_s": float("nan"), "angular_rad_s": 1.0}),
        ("random_walk", {"linear_m_s": "0.1", "angular_rad_s": 1.0}),
        ("go_to_goal", {"avoid": "true"}),
        ("behavior", {"behavior": "/tmp/mine.py", "safety": "off"}),
        ("behavior_aggregation", {"safety": "off", "behavior": "/tmp/mine.py"}),
        ("behavior_rendezvous", {"gain_1_s": -1.0, "max_linear_m_s": 0.1, "safety": "off"}),
        (
            "behavior_segregation",
            {"groups": 2.5, "own_m": 0.2, "others_m": 1.0, "max_linear_m_s": 0.1, "safety": "off"},
        ),
        ("swarm_go_to", {**CIRCLE, "shape": ["circle"]}),
    ],
)
def test_no_other_program_and_no_other_value_is_accepted(program, values):
    with pytest.raises(RequestError):
        check_values(program, values)


class Started:
    """Programs whose guards run Python code."""

    def __init__(self):
        self.ended, self._calls = [], queue.Queue()
        self.programs = Programs("/hero_monitor", lambda *call: self._calls.put(call), self.ended.append)
        self.programs.paths = {name: sys.executable for name in (*OFFERS, "record")}

    def start(self, code, program="random_walk", robots=("hero_0", "hero_1"), folder=None):
        child = ChildProcess(program, robots, folder=folder)
        self.programs.start(child, ["-c", code])
        return child

    def wait(self):
        """Wait for the end of a program as the monitor does, which beats: a busy PC starts a Python for seconds."""
        while True:
            with contextlib.suppress(queue.Empty):
                function, *arguments = self._calls.get(timeout=BEAT_S)
                return function(*arguments)
            self.programs.beat()


@pytest.fixture()
def started():
    one = Started()
    yield one
    one.programs.close()


def wait_for_output(monkeypatch):
    """Return a function that reads a line of what programs print, into a pipe, and beats until there is one."""
    descriptor, write = os.pipe()
    output = os.fdopen(descriptor, "rb", buffering=0)
    real = subprocess.Popen

    def start(command, **options):
        return real(command, **{**options, "stdout": write} if "stdout" in options else options)

    monkeypatch.setattr(programs_module.subprocess, "Popen", start)

    def read(programs):
        while not select.select([output], [], [], BEAT_S)[0]:
            programs.beat()
        return output.readline()

    return read


@pytest.mark.slow
def test_a_program_that_a_page_ends_gets_sigint_and_its_robots_are_stopped(started, monkeypatch):
    read = wait_for_output(monkeypatch)
    child = started.start(OBEDIENT)
    assert read(started.programs) == b"runs\n"
    assert started.programs.find_driver(["hero_1"]) == "random walk drives hero_1: end it first"
    started.programs.end(1)
    started.wait()
    assert read(started.programs) == b"robots are stopped\n"
    assert (started.ended, child.driven, child.failure) == ([child], ["hero_0", "hero_1"], "")
    assert started.programs.describe() == []


@pytest.mark.slow
def test_a_program_that_ignores_sigint_is_ended_by_force(started, monkeypatch):
    read = wait_for_output(monkeypatch)
    monkeypatch.setattr(programs_module, "PATIENCE_S", 0.1)
    started.start(DEAF)
    assert read(started.programs) == b"deaf\n"
    started.programs.end_those_of(["hero_0"])
    started.wait()
    assert started.programs.count == 0


def is_alive(pid):
    try:
        state = Path("/proc/%d/stat" % pid).read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state != "Z"


@pytest.mark.slow
def test_a_program_whose_guard_is_killed_ends_too(started, monkeypatch):
    read = wait_for_output(monkeypatch)
    started.start("import os; print(os.getppid(), os.getpid(), flush=True); import signal; signal.pause()")
    guard, program = map(int, read(started.programs).split())
    os.kill(guard, signal.SIGKILL)
    started.wait()
    wait_for(lambda: not is_alive(program), "the end of the program")
    assert started.programs.describe()[0]["failure"]


@pytest.mark.slow
def test_why_a_program_failed_is_shown_until_another_one_starts(started):
    opened = len(os.listdir("/proc/self/fd"))
    started.start("import sys; sys.exit('swarm_go_to: no way')")
    started.wait()
    assert len(os.listdir("/proc/self/fd")) == opened, "pipe and output are closed with it"
    assert [row["failure"] for row in started.programs.describe()] == ["swarm_go_to: no way"]
    started.start("print()")
    started.wait()
    assert started.programs.describe() == []


@pytest.mark.slow
def test_the_node_of_a_behavior_of_a_file_has_the_name_of_the_file(started, monkeypatch):
    name = "behavior_/home/a/own-1/design-1_1.controller"
    monkeypatch.setitem(OFFERS, name, OFFERS["random_walk"])
    started.programs.paths[name] = sys.executable
    started.start("import sys; sys.exit(sys.argv[-1])", program=name)
    started.wait()
    assert [row["failure"] for row in started.programs.describe()] == ["__name:=hero_monitor_design_1_1_1"]


@pytest.mark.slow
def test_all_programs_are_told_to_end_before_one_is_waited_for(started, monkeypatch):
    read = wait_for_output(monkeypatch)
    children = [started.start(OBEDIENT, robots=["hero_%d" % number]) for number in range(2)]
    assert [read(started.programs), read(started.programs)] == [b"runs\n"] * 2
    told = []
    started.programs._on_end = lambda _: told.append([child.is_ending for child in children])
    started.programs.close(DEADLINE_S)
    assert told[0] == [True, True]


@pytest.mark.slow
def test_the_end_of_the_monitor_ends_the_program(monkeypatch):
    # As the kernel does with the pipe of a monitor that was killed.
    read = wait_for_output(monkeypatch)
    child = ChildProcess("random_walk", ["hero_0"])
    thread = threading.Thread(target=child.run, args=([sys.executable, "-c", OBEDIENT],))
    thread.start()
    assert read(child) == b"runs\n"
    os.close(child._monitor_end)
    child.is_ending = True
    thread.join(DEADLINE_S)
    assert read(child) == b"robots are stopped\n"


@pytest.mark.slow
def test_a_stop_of_all_robots_ends_programs_but_not_the_recording(started, monkeypatch, tmp_path):
    read = wait_for_output(monkeypatch)
    (tmp_path / "hero_0.bag").write_bytes(b"x" * 7)
    monkeypatch.setattr(programs_module, "SIZE_PERIOD_S", 0.01)
    recording = started.start(OBEDIENT, "record", robots=(), folder=tmp_path)
    assert read(started.programs) == b"runs\n"
    assert not started.programs.end_all()
    assert started.programs.find_recording() is recording
    recording.end()
    started.wait()
    assert recording.bytes == 7
    assert started.programs.find_recording() is None


@pytest.mark.slow
def test_the_length_of_a_recording_counts_from_its_file_on(started, monkeypatch, tmp_path):
    read = wait_for_output(monkeypatch)
    starts_s = []

    def measure(folder):
        starts_s.append(started.programs.find_recording().start_s)
        return 7 if len(starts_s) >= 3 else 0

    monkeypatch.setattr(programs_module, "measure", measure)
    monkeypatch.setattr(programs_module, "SIZE_PERIOD_S", 0.01)
    recording = started.start(OBEDIENT, "record", robots=(), folder=tmp_path)
    assert read(started.programs) == b"runs\n"
    wait_for(lambda: len(starts_s) >= 4, "four looks at the folder")
    recording.end()
    started.wait()
    assert starts_s[0] < starts_s[1] < starts_s[2] == starts_s[3]


@pytest.mark.parametrize(("folder", "patience_s"), [(None, "3.0"), (Path("/x"), "20.0")])
def test_a_recorder_has_time_to_close_its_files_and_robots_stop_at_once(monkeypatch, folder, patience_s):
    start = create_autospec(subprocess.Popen)
    monkeypatch.setattr(programs_module.subprocess, "Popen", start)
    child, output = ChildProcess("record", folder=folder), io.BytesIO()
    assert child._spawn(["/record", "-a"], output) is start.return_value
    ((command,), options) = start.call_args
    assert command == [sys.executable, "-m", "hero_monitor.control.guard", patience_s, "/record", "-a"]
    held = {"stdin": child._guard_end, "stdout": output, "stderr": subprocess.STDOUT, "start_new_session": True}
    assert options == held and not os.get_blocking(child._monitor_end)
    with pytest.raises(OSError, match="Bad file"):
        os.fstat(child._guard_end)
    start.return_value.wait.return_value = 3
    assert child._wait_for(start.return_value) == 3
    start.return_value.wait.assert_called_once_with(1.0)
    child.end()


def test_the_length_of_a_recording_ends_when_it_is_told_to(started, tmp_path):
    recording = started.programs._running[1] = ChildProcess("record", folder=tmp_path)
    recording.end()
    recording.start_s -= 100.0
    recording.end_s = recording.start_s + 7.5
    assert started.programs.describe()[0]["seconds"] == 7
    recording.start_s += 100.0
    assert started.programs.describe()[0]["seconds"] == 0, "its first file came too late"


@pytest.mark.parametrize(("program", "driven"), [("follow", ["hero_1"]), ("led_show", [])])
def test_robots_that_a_program_does_not_drive_are_left_alone(program, driven):
    programs = Programs("/hero_monitor", None, None)
    child = programs._running[1] = ChildProcess(program, ["hero_0", "hero_1"])
    assert child.driven == driven and programs.find_driver(["hero_0"]) == ""
    programs.end_those_of(["hero_2"])
    assert not child.is_ending
    programs.end_those_of(["hero_2", "hero_0"])
    assert child.is_ending, "a stop of one that it does not drive ends it, too"


def test_a_program_that_cannot_be_started_is_listed_with_the_reason(started, monkeypatch):
    full = OSError(errno.ENOSPC, "No space left on device")
    monkeypatch.setattr(programs_module.tempfile, "TemporaryFile", Mock(side_effect=full))
    child = started.start("print()")
    child.thread.join(DEADLINE_S)
    forget, number = started._calls.get_nowait()
    forget(number)
    assert (started.programs.count, started.ended, child.is_ending) == (0, [child], True)
    assert [row["failure"] for row in started.programs.describe()] == [str(full)]


def test_every_running_program_is_told_that_the_monitor_runs():
    programs = Programs.__new__(Programs)
    programs._running = {number: create_autospec(ChildProcess, instance=True) for number in (4, 7)}
    programs.beat()
    assert [child.beat.call_count for child in programs._running.values()] == [1, 1]


def test_a_program_is_known_to_end_before_its_guard_can_end_it(monkeypatch):
    child, known = ChildProcess("record"), []
    monkeypatch.setattr(programs_module, "os", SimpleNamespace(close=lambda _: known.append(child.is_ending)))
    child.end()
    assert known == [True], "else its end would be taken for a failure"


@pytest.mark.parametrize("is_gone", [True, False])
def test_a_guard_that_is_gone_or_hangs_does_not_disturb_the_beat_of_others(is_gone):
    child = ChildProcess("record")
    if is_gone:
        os.close(child._guard_end)
    while not is_gone and select.select([], [child._monitor_end], [], 0.0)[1]:
        os.write(child._monitor_end, bytes(4096))
    child.beat()
    for _ in range(2):
        child.end()
    child.beat()
    assert child.is_ending
    if not is_gone:
        os.close(child._guard_end)
