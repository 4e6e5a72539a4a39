"""The guard of a program in virtual time, and limits of what pages and programs may take."""

import os
import re
import runpy
import select
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import create_autospec

import pytest

import hero_node
import sources
from hero_client.controllers import AvoidanceLaw
from hero_client.values import MAX_ANGULAR_RAD_S, MAX_LINEAR_M_S
from hero_monitor.control import guard as module
from hero_monitor.control import programs as programs_module
from hero_monitor.control.offers import OFFERS, describe_offers
from hero_monitor.control.programs import ChildProcess, Programs
from hero_monitor.control.requests import RequestError, read_request
from hero_monitor.fleet_feed.camera_picture import CameraPicture
from hero_monitor.fleet_feed.page_state import LogRing, PageState
from hero_monitor.fleet_feed.placement import Placement
from hero_node import Pose
from hero_test.nonempty import nonempty

MAX_DISTANCE_M, MAX_GOAL_M, MAX_TEXT_LENGTH = 10000.0, 1000.0, 16000


def run_guard(monkeypatch, signs, ends_after=10**6, code=0):
    """Return (exit code, polls, patience of the end that was needed); signs: what stdin holds at each poll."""
    signs, state = list(signs), {"polls": 0, "ended": None, "ignored": []}

    def select(readable, *others):
        assert readable == [0] and others[2] == 0.1
        state["polls"] += 1
        return ([0] if signs and signs[0] is not None else []), [], []

    def read(descriptor, length):
        assert descriptor == 0
        return signs[0]

    def poll():
        if state["polls"] and signs:
            signs.pop(0)
        return code if state["polls"] >= ends_after else None

    def end(process, patience_s):
        state["ended"] = patience_s
        return -signal.SIGINT

    monkeypatch.setattr(module.subprocess, "Popen", lambda command, stdin: SimpleNamespace(poll=poll))
    monkeypatch.setattr(module.signal, "signal", lambda number, handler: state["ignored"].append((number, handler)))
    monkeypatch.setattr(module, "select", SimpleNamespace(select=select))
    monkeypatch.setattr(module, "os", SimpleNamespace(read=read))
    monkeypatch.setattr(module, "end_process", end)
    found = module.guard(["program"], 3.0)
    assert state["ignored"] == [(number, signal.SIG_IGN) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)]
    return found, state["polls"], state["ended"]


def test_a_program_ends_with_the_monitor_after_five_seconds_of_silence(monkeypatch):
    ended = 128 + signal.SIGINT
    assert run_guard(monkeypatch, []) == (ended, 50, 3.0)
    assert run_guard(monkeypatch, [None] * 40 + [b"."] + [None] * 100) == (ended, 91, 3.0)
    assert run_guard(monkeypatch, [b"."] * 200 + [b""]) == (ended, 201, 3.0)
    for code, told in ((0, 0), (1, 1), (-9, 137)):
        assert run_guard(monkeypatch, [b"."] * 100, ends_after=7, code=code) == (told, 7, None)


def test_a_guard_is_told_its_patience_and_the_command(monkeypatch):
    process = create_autospec(subprocess.Popen, instance=True)
    process.poll.return_value = None
    started = create_autospec(subprocess.Popen, return_value=process)
    ended = create_autospec(hero_node.end_process, return_value=-signal.SIGKILL)
    monkeypatch.setattr(subprocess, "Popen", started)
    monkeypatch.setattr(hero_node, "end_process", ended)
    monkeypatch.setattr(signal, "signal", create_autospec(signal.signal))
    monkeypatch.setattr(select, "select", lambda *_: ([0], [], []))
    monkeypatch.setattr(os, "read", lambda *_: b"")
    monkeypatch.setattr(sys, "argv", ["guard.py", "3.5", "walk", "--fast"])
    monkeypatch.delitem(sys.modules, module.__name__)
    with pytest.raises(SystemExit) as caught:
        runpy.run_module(module.__name__, run_name="__main__")
    assert caught.value.code == 137
    started.assert_called_once_with(["walk", "--fast"], stdin=subprocess.DEVNULL)
    ended.assert_called_once_with(process, 3.5)


OFFERED = {
    "swarm_go_to": {
        "shape": ("circle", (), ""), "spacing_m": (0.3, (AvoidanceLaw().min_spacing_m, 2.0), "m"),
        "turn_deg": (0.0, (-360.0, 360.0), "deg"),
        "x_m": (0.0, (-1000.0, 1000.0), "m"), "y_m": (0.0, (-1000.0, 1000.0), "m"),
        "linear_m_s": (0.08, (0.01, 0.2), "m/s"),
    },
    "go_to_goal": {"avoid": (False, (), "")},
    "random_walk": {"linear_m_s": (0.1, (0.01, 0.2), "m/s"), "angular_rad_s": (1.5, (0.1, 4.0), "rad/s")},
    "follow": {"gap_m": (0.15, (0.1, 2.0), "m"), "linear_m_s": (0.15, (0.01, 0.2), "m/s")},
    "led_show": {
        "pattern": ("rainbow", (), ""), "period_s": (4.0, (0.5, 60.0), "s"), "brightness": (1.0, (0.0, 1.0), ""),
    },
}  # fmt: skip


def test_programs_of_pages_begin_with_known_values_within_known_limits():
    offered = {offer["program"]: offer["fields"] for offer in describe_offers(list(OFFERED))}
    found = {
        program: {field["name"]: (field["default"], tuple(field["limits"] or ()), field["unit"]) for field in fields}
        for program, fields in offered.items()
    }
    assert found == OFFERED and list(found) == list(OFFERED)


def test_what_pages_offer_is_what_launch_files_say():
    for name, offer in OFFERS.items():
        text = (sources.PACKAGES[offer.package] / "launch" / (offer.program + ".launch")).read_text(encoding="utf-8")
        for field, default, doc in nonempty(re.findall(r'<arg name="(\w+)" default="([^"]*)" doc="([^"]*)"', text)):
            given = offer.fields.get(field)
            if given is None or not isinstance(given.default, float):
                continue
            assert given.default == float(default), (name, field)
            low, high = re.search(r"\(?(-?[\d.]+)\.\.([\d.]+)\)?", doc).groups()
            assert float(low) <= given.limits[0] < given.limits[1] == float(high), (name, field)
    assert OFFERS["go_to_goal"].fields["avoid"].default is False
    assert OFFERS["behavior_milling"].fields["safety"].default == "fence and robots", "which the user has to switch off"
    formation = OFFERS["swarm_go_to"].fields
    assert [formation[name].limits for name in ("x_m", "turn_deg")] == [(-1e3, 1e3), (-360, 360)]
    assert formation["spacing_m"].limits[1] == 2.0 and OFFERS["led_show"].fields["period_s"].limits[0] == 0.5


def test_requests_end_at_the_limits_of_robots_and_texts():
    def read(**fields):
        return read_request(str({"heard_ms": 5, "pressed_ms": 5, **fields}).replace("'", '"'))

    drive, goal = {"do": "drive", "robots": ["a"]}, {"do": "goal", "robots": ["a"]}
    read(**drive, linear=-MAX_LINEAR_M_S, angular=MAX_ANGULAR_RAD_S)
    read(**goal, x=MAX_GOAL_M, y=-1000.0, yaw=-6.28)
    for wrong in (
        {**drive, "linear": 0.2001, "angular": 0.0},
        {**drive, "linear": 0.0, "angular": -8.01},
        {**goal, "x": 1000.1, "y": 0.0},
        {**goal, "x": 0.0, "y": 0.0, "yaw": 6.3},
        {"do": "end", "number": 1.1e9},
    ):
        with pytest.raises(RequestError, match="is missing or invalid"):
            read(**wrong)
    text = '{"do":"stop"}'
    assert read_request(text + " " * (MAX_TEXT_LENGTH - len(text))) == {"do": "stop"}
    for wrong in (text + " " * (MAX_TEXT_LENGTH - len(text) + 1), text.encode()):
        with pytest.raises(RequestError, match="not a short text"):
            read_request(wrong)


def test_all_programs_are_waited_for_together_at_the_end(monkeypatch):
    clock, ended, joined, told = SimpleNamespace(now_s=100.0), [], [], []
    monkeypatch.setattr(programs_module, "time", SimpleNamespace(monotonic=lambda: clock.now_s))
    programs = Programs("/hero_monitor", None, lambda child: ended.append(child) or told.append(len(joined)))

    def join(timeout_s):
        joined.append(timeout_s)
        clock.now_s += timeout_s

    children = [
        ChildProcess("random_walk", ["hero_0"], [(1.2345, -0.5)]),
        ChildProcess("follow", ["hero_1", "hero_2"]),
        ChildProcess("record", folder=Path("/x")),
    ]
    for number, child in enumerate(children, 1):
        programs._running[number] = child
        child.thread = SimpleNamespace(join=join)
    clock.now_s += 7.9
    rows = programs.describe()
    assert [row["seconds"] for row in rows] == [7] * 3 and rows[0]["places"] == [[1234, -500]]
    assert [row["title"] for row in rows] == ["random walk", "follow the first one", "recording"]
    assert rows[0]["bytes"] == 0 and rows[2]["folder"] == "/x" and not rows[0]["ending"]
    programs.close()
    assert joined == [3.0, 0.0] and ended == children[:2] and all(child.is_ending for child in children)
    assert told == [1, 2], "its robots are stopped after it has ended"
    programs._forget(1)
    assert 1 not in programs._running and ended[-1] is children[0]


def test_robots_without_a_place_stand_a_meter_apart_around_the_middle():
    placement = Placement("world")
    placement.set_robots(["a", "b", "c", "d"])
    places_m = [placement.to_map(name, Pose(0.0, 0.0, 0.0)).x_m for name in "abcd"]
    assert places_m == [-1.5, -0.5, 0.5, 1.5] and placement.to_map("e", Pose(1.0, 2.0, 3.0)) == (1.0, 2.0, 3.0)


def test_an_outline_is_whole_millimeters_within_the_map():
    picture = CameraPicture()
    for corners, box in (
        ([(0.1234, 0.2), (1.0004, 0.2), (1.0, 1.0), (0.2, 1.0)], [123, 200, 1000, 1000]),
        ([(0.0, 0.0), (1.0, 1.1 * MAX_DISTANCE_M), (1.0, 1.0), (0.0, 1.0)], None),
        ([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)], None),
    ):
        points = [SimpleNamespace(x=x_m, y=y_m) for x_m, y_m in corners]
        outline = SimpleNamespace(polygon=SimpleNamespace(points=points), header=SimpleNamespace(frame_id="/map"))
        picture.receive_outline(outline)
        assert picture._box_mm == box and picture._frame == "map"


def test_lines_are_numbered_from_one_and_versions_counted():
    ring = LogRing()
    assert ring.encode_after(0) == '{"missed":0,"lines":[]}'
    ring.append(1.23456, 2, "node", "", "a")
    assert ring.encode_after(0) == '{"missed":0,"lines":[[1,1.235,2,"node","","a"]]}'
    ring.skip(2)
    assert ring.encode_after(1) == '{"missed":2,"lines":[]}'
    state = PageState()
    assert state.put("a", 1) and not state.put("a", 1) and state.put("a", 2)
