"""The monitor's loop: what is done in which order at its end, and what each page is sent."""

import contextlib
import json
from types import SimpleNamespace
from unittest.mock import create_autospec

import pytest
import tornado.ioloop

from hero_client.ros import Drivers
from hero_monitor import program as module
from hero_monitor.background import Background
from hero_monitor.control.drive_requests import DriveRequests
from hero_monitor.control.programs import Programs
from hero_monitor.fleet_feed.camera_picture import CameraPicture
from hero_monitor.fleet_feed.feed import FleetFeed
from hero_monitor.fleet_feed.page_state import PageState
from hero_monitor.page_requests import PageRequests
from hero_monitor.program import LESSON, Monitor
from hero_monitor.serving import invitation
from hero_monitor.serving import server as server_module
from hero_monitor.serving.lesson import TEACHER, VIEWER, Lesson, Role, User
from hero_monitor.serving.server import MonotonicLoop, PageSocket, Server
from hero_node import ProgramError
from hero_node.ros import Program

DRIVER = Role("driver", frozenset(["hero_7", "hero_2"]))


class Page:
    """A page as the monitor sees it."""

    def __init__(self, user=None, ready=True, picture=False):
        self.socket = create_autospec(PageSocket, instance=True, ready=ready, picture=picture)
        self.socket.user, self.socket.shown_user, self.socket.seen = user or User("", TEACHER), None, {}

    @property
    def sent(self):
        return [json.loads(one.args[0]) for one in self.socket.send.call_args_list]


@pytest.fixture(name="monitor")
def make_monitor(monkeypatch):
    """A monitor whose parts note what they are asked for, in one list: monitor.calls."""
    monitor, calls = Monitor.__new__(Monitor), []
    parts = {
        "_loop": MonotonicLoop,
        "_server": Server,
        "_background": Background,
        "_commander": DriveRequests,
        "_programs": Programs,
        "_requests": PageRequests,
        "_feed": FleetFeed,
        "_end_check": tornado.ioloop.PeriodicCallback,
    }
    for name, kind in parts.items():
        part = create_autospec(kind, instance=True)
        setattr(monitor, name, part)
        for method in ("start", "stop", "close", "shutdown", "listen"):
            if hasattr(part, method):
                getattr(part, method).side_effect = lambda *_, name=name, method=method, **__: calls.append(
                    f"{name[1:]}.{method}"
                )
    monitor._feed.page_state, monitor._feed.drivers = PageState(), create_autospec(Drivers, instance=True)
    monitor._server.pages = []
    monitor._parameters = SimpleNamespace(host="0.0.0.0", port=8080, control=False)
    monitor._program = create_autospec(Program, instance=True, running=True)
    monitor._lesson, monitor.calls = None, calls
    monkeypatch.setattr(module.rospy, "loginfo", lambda *_: None)
    monkeypatch.setattr(module, "read_clock_ms", lambda: 5000)
    return monitor


@pytest.mark.parametrize("classroom", [False, True])
def test_a_monitor_is_wired_as_its_parameters_say(monkeypatch, classroom):
    kinds = FleetFeed, DriveRequests, PageRequests, Background
    feed, commander, requests, background = made = [create_autospec(kind, instance=True) for kind in kinds]
    feed.page_state, feed.drivers, feed.picture = PageState(), create_autospec(Drivers, instance=True), CameraPicture()
    feed.lab_file = SimpleNamespace(topics=[SimpleNamespace(name="battery", unit="V")])
    requests.programs = create_autospec(Programs, instance=True)
    for kind, instance in zip(kinds, made):
        monkeypatch.setattr(module, kind.__name__, create_autospec(kind, return_value=instance))
    for name in ("Server", "MonotonicLoop"):
        monkeypatch.setattr(server_module, name, create_autospec(getattr(server_module, name)))
    periodic = create_autospec(tornado.ioloop.PeriodicCallback)
    monkeypatch.setattr(tornado.ioloop, "PeriodicCallback", periodic)
    monkeypatch.setattr(module.rospy, "get_name", lambda: "/lab/hero_monitor")
    monkeypatch.setattr(module, "raise_file_limit", lambda: 601)
    monkeypatch.setattr(module, "read_token", create_autospec(module.read_token, return_value="x" * 16))
    parameters = SimpleNamespace(host="10.42.0.1", token_file="key", host_names=["lab"], control=True, rate_hz=5.0)
    parameters.map_frame, parameters.classroom = "world", classroom
    monitor = Monitor(parameters, None)
    module.FleetFeed.assert_called_once_with("world", background)
    module.DriveRequests.assert_called_once_with(feed.drivers, background)
    module.read_token.assert_called_once_with("10.42.0.1", "key")
    *given, lesson = module.PageRequests.call_args[0]
    later, broadcast = server_module.MonotonicLoop.return_value.add_callback, monitor._broadcast_updates
    assert given == [parameters, feed, commander, background, later, broadcast] and (lesson is not None) == classroom
    hello = {"control": True, "topics": [["battery", "V"]], "node": "lab/hero_monitor"}
    assert json.loads(feed.page_state.take_updates({}))["hello"] == hello
    ((access, limits, actions), _) = server_module.Server.call_args
    assert access.lesson is lesson and access.admits_host("lab") and access.admits_host("10.42.0.1")
    assert access.find_key("x" * 16) and not access.admits_host("other") and limits._connections_max == 300
    feed.picture.jpeg = b"newest"
    assert actions[:3] == (monitor._enter, requests.receive, monitor._leave) and actions.find_picture() == b"newest"
    calls = (monitor._update_pages, 200.0), (monitor._step, 60.0), (monitor._send_clock, 120.0)
    assert [one.args for one in periodic.call_args_list] == [*calls, (monitor._check_end, 200.0)]
    assert monitor._repeated == [periodic.return_value] * 3 and not periodic.return_value.start.called


ENDS = ["programs.close", "commander.close", "server.close", "background.shutdown"]


@pytest.mark.parametrize("error", [None, KeyboardInterrupt, ArithmeticError])
def test_programs_and_robots_are_stopped_before_pages_whatever_ends_it(monitor, error):
    if error:
        monitor._loop.start.side_effect = error
    else:
        monitor._loop.start.side_effect = lambda: monitor.calls.append("served")
    with pytest.raises(error) if error else contextlib.nullcontext():
        monitor.run()
    assert monitor.calls == ["server.listen", "end_check.start", *([] if error else ["served"]), *ENDS]
    assert not monitor._background.submit.called, "it only shows"
    monitor._background.shutdown.assert_called_once_with(wait=False)


def test_phones_are_led_to_the_port_that_was_opened(monitor, monkeypatch):
    monitor._server.listen.side_effect, monitor._server.listen.return_value = None, 40123
    monitor._lesson, said = Lesson(), []
    monkeypatch.setattr(module.rospy, "loginfo", lambda *words: said.append(words))
    monkeypatch.setattr(invitation, "find_source_address", lambda _: "10.42.0.1")
    monitor.run()
    monitor._server.listen.assert_called_once_with("0.0.0.0", 8080)
    link, code = "http://10.42.0.1:40123/", monitor._lesson.class_code
    assert (monitor._invitation["code"], monitor._invitation["link"]) == (code, link)
    assert said[0][1:] == (code, f"{link}#{code}")
    assert said[1][1:] == (link, " (view only; control:=true allows driving)")


def test_behaviors_are_offered_before_programs_are_looked_for(monitor, monkeypatch):
    offers = {"follow": "built in"}
    monitor._parameters.behavior_folder = "/own"
    monkeypatch.setattr(module, "OFFERS", offers)
    monkeypatch.setattr(module, "find_behaviors", create_autospec(module.find_behaviors, return_value={"own": "new"}))
    monkeypatch.setattr(module, "find_programs", create_autospec(module.find_programs, side_effect=lambda: [*offers]))
    assert monitor._find_programs() == ["follow", "own"] and offers["own"] == "new"
    module.find_behaviors.assert_called_once_with("/own")


def test_wrong_parameters_are_told_before_a_library_is_missed(monkeypatch):
    calls = []
    program = create_autospec(Program, instance=True)
    program.__enter__.return_value = program
    monkeypatch.setattr(module, "Program", create_autospec(Program, return_value=program))
    monkeypatch.setattr(module, "load_parameters", lambda: calls.append("parameters") or "loaded")
    monkeypatch.setattr(module, "import_optional", lambda *names: calls.append(names))
    monkeypatch.setattr(module, "Monitor", create_autospec(Monitor))
    module.Monitor.side_effect = lambda *given: calls.append(given) or module.Monitor.return_value
    module.main()
    assert calls == ["parameters", ("tornado", "python3-tornado"), ("loaded", program)]
    module.Monitor.return_value.run.assert_called_once_with()
    module.Program.assert_called_once_with("hero_monitor")


def test_a_port_that_is_taken_is_an_error_with_what_to_do(monitor):
    monitor._server.listen.side_effect = OSError(98, "Address already in use")
    with pytest.raises(ProgramError, match=r"cannot listen on 0\.0\.0\.0 port 8080: Address already in use; choose"):
        monitor.run()
    assert not monitor._loop.start.called


def test_what_programs_can_be_started_is_found_in_the_background(monitor):
    monitor._parameters.control = True
    finding = monitor._background.submit.return_value
    finding.add_done_callback.side_effect = lambda then: then(SimpleNamespace(result=lambda: {"record": "/opt/record"}))
    monitor.run()
    monitor._background.submit.assert_called_once_with(monitor._find_programs)
    ((offer, paths),) = [one.args for one in monitor._loop.add_callback.call_args_list]
    offer(paths)
    assert monitor._programs.paths == {"record": "/opt/record"}
    offers = json.loads(monitor._feed.page_state.take_updates({}))["offers"]
    assert offers["record"] is True and offers["programs"] == []


def test_guards_are_told_that_it_runs_until_the_program_ends(monitor):
    monitor._check_end()
    assert monitor._programs.beat.call_count == 1 and monitor.calls == []
    monitor._program.running = False
    monitor._check_end()
    assert monitor.calls == ["loop.stop"]


def test_between_updates_robots_are_stopped_and_a_new_stop_is_shown(monitor):
    monitor._feed.read_stop.side_effect, steps = [False, True], []
    monitor._commander.step.side_effect = lambda: steps.append("due stops")
    monitor._requests.end_motions_of_stopped_robots.side_effect = lambda: steps.append("ends")
    page = Page()
    monitor._server.pages.append(page.socket)
    monitor._feed.page_state.put("stop", {"text": "stopping"})
    monitor._step()
    assert steps == ["due stops", "ends"], "what is due waits for nothing"
    assert page.sent == []
    monitor._step()
    assert page.sent == [{"stop": {"text": "stopping"}}]


def test_each_page_gets_what_is_new_to_it_and_a_slow_one_waits(monitor):
    fast, slow = Page(), Page(ready=False)
    monitor._server.pages += [slow.socket, fast.socket]
    monitor._feed.page_state.put("fleet", 1)
    for _ in range(2):
        monitor._broadcast_updates()
    assert fast.sent == [{"fleet": 1}] and slow.sent == [] and slow.socket.send_waiting.call_count == 2
    slow.socket.ready = True
    monitor._feed.page_state.put("fleet", 2)
    monitor._broadcast_updates()
    assert slow.sent == [{"fleet": 2}] and fast.sent == [{"fleet": 1}, {"fleet": 2}]


def test_codes_are_shown_to_teachers_alone(monitor):
    monitor._lesson, monitor._invitation = create_autospec(Lesson, instance=True), {"link": "http://pc"}
    monitor._lesson.list_drivers.return_value = [["123456", ["hero_2"]]]
    monitor._programs.describe.return_value = []
    pages = [Page(User(name, role)) for name, role in (("Kim", VIEWER), ("Lee", DRIVER), ("Ada", TEACHER))]
    monitor._server.pages += [page.socket for page in pages]
    monitor._update_pages()
    viewer, driver, teacher = ([part for message in page.sent for part in message] for page in pages)
    assert LESSON not in viewer + driver and "programs" in viewer
    lesson = next(message[LESSON] for message in pages[2].sent if LESSON in message)
    assert lesson["drivers"] == [["123456", ["hero_2"]]] and lesson["link"] == "http://pc" and teacher
    assert lesson["users"] == [["Ada", "teacher", []], ["Kim", "viewer", []], ["Lee", "driver", ["hero_2", "hero_7"]]]


@pytest.mark.parametrize("shows", [[False, False], [False, True]])
def test_the_picture_is_subscribed_to_while_a_page_shows_it(monitor, shows):
    monitor._server.pages += [Page(picture=picture).socket for picture in shows]
    monitor._programs.describe.return_value = []
    monitor._update_pages()
    monitor._feed.update_subscriptions.assert_called_once_with(True, any(shows))
    assert monitor._feed.read.called


def test_each_page_hears_the_clock_and_who_its_user_is_now(monitor):
    page, slow = Page(User("Lee", DRIVER)), Page(ready=False)
    monitor._server.pages += [slow.socket, page.socket]
    for _ in range(2):
        monitor._send_clock()
    user = {"name": "Lee", "title": "driver", "robots": ["hero_2", "hero_7"]}
    assert page.sent == [{"clock_ms": 5000, "user": user}, {"clock_ms": 5000}] and slow.sent == []
    page.socket.user = User("Lee", VIEWER)
    monitor._send_clock()
    assert page.sent[-1] == {"clock_ms": 5000, "user": {"name": "Lee", "title": "viewer", "robots": []}}
