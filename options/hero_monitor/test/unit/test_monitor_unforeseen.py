"""An error that was not foreseen is seen: what handles others lets it pass, and names no wrong cause."""

import contextlib
import sys
from collections import deque
from types import SimpleNamespace

import pytest
from test_monitor_requests import Desk

from hero_monitor import foxglove, page_requests, parameters
from hero_monitor import program as program_module
from hero_monitor.control import activity, drive_requests, offers, programs, requests
from hero_monitor.control.programs import ChildProcess, Programs
from hero_monitor.fleet_feed import feed
from hero_monitor.fleet_feed.page_state import PageState
from hero_monitor.serving import access, client_limits, invitation, server
from hero_test.checks.unforeseen import UnforeseenError, fail, fail_once


def run_child(monkeypatch, _folder):
    child = ChildProcess("record")
    monkeypatch.setattr(child, "_spawn", lambda *_: SimpleNamespace(pid=0))
    monkeypatch.setattr(child, "_wait_for", lambda _: 0)
    monkeypatch.setattr(programs, "os", SimpleNamespace(killpg=fail))
    child.run([])


def wait_for_child(monkeypatch, _folder):
    ChildProcess("record")._wait_for(SimpleNamespace(wait=fail_once(0)))


def beat(monkeypatch, _folder):
    child = ChildProcess("record")
    monkeypatch.setattr(programs, "os", SimpleNamespace(write=fail))
    child.beat()


def run_program(monkeypatch, _folder):
    held = Programs("/hero_monitor", lambda *_: None, lambda _: None)
    held._run(1, SimpleNamespace(run=fail), [])


def start_foxglove(monkeypatch, _folder):
    @contextlib.contextmanager
    def begin(_name):
        yield None

    monkeypatch.setattr(foxglove, "Program", begin)
    monkeypatch.setattr(foxglove, "read_parameters", lambda _: {"host": "127.0.0.1", "port": 8765})
    monkeypatch.setattr(foxglove, "import_optional", lambda *_: SimpleNamespace(start_server=fail))
    foxglove.main()


def read_token(monkeypatch, folder):
    (folder / "token").write_text("x" * 20)
    monkeypatch.setattr(parameters, "os", SimpleNamespace(path=parameters.os.path, fstat=fail))
    parameters.read_token("0.0.0.0", str(folder / "token"))


def make_qr_code(monkeypatch, folder):
    (folder / "qrcode.py").write_text(f"from {__name__} import UnforeseenError\nraise UnforeseenError")
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.delitem(sys.modules, "qrcode", raising=False)
    invitation.make_qr_rows("http://10.42.0.1:8088/")


def note(monkeypatch, folder):
    monkeypatch.setattr(activity.rospkg, "get_ros_home", lambda: str(folder))
    monkeypatch.setattr(activity.csv, "writer", fail)
    activity._write(("2026-11-22T10:00:00", "Ada", "drive", "hero_3"))


def log_in(monkeypatch, _folder):
    monkeypatch.setattr(server.json, "loads", fail)
    page = SimpleNamespace(is_own_page=True, request=SimpleNamespace(body=b""), _find_key=lambda token: token)
    page.set_secure_cookie = page.set_status = lambda *_, **__: None
    server.LoginHandler.post(page)


def send_goal(monkeypatch, _folder):
    commander = drive_requests.DriveRequests(None, None)
    monkeypatch.setattr(commander, "_has_listener", fail)
    commander.send_goal("hero_0", "map", None, False)


def read_log(monkeypatch, _folder):
    monkeypatch.setattr(feed.Log, "deserialize", fail)
    lines = SimpleNamespace(page_state=PageState(), _log_bytes=deque([b"x"]), drivers=SimpleNamespace(names=list))
    feed.FleetFeed._read_log(lines)


def listen(monkeypatch, _folder):
    wanted = SimpleNamespace(host="127.0.0.1", port=8088)
    program_module.Monitor.run(SimpleNamespace(_parameters=wanted, _server=SimpleNamespace(listen=fail)))


def break_part(target, name, act):
    """Return a case: a part of a module that fails, and what then is to fail too."""

    def run(monkeypatch, _folder):
        monkeypatch.setattr(target, name, fail)
        act(monkeypatch)

    run.__name__ = act.__name__ if act.__name__ != "<lambda>" else f"{target.__name__}.{name}".rpartition("hero_")[2]
    return run


def ask(monkeypatch):
    desk = Desk(monkeypatch)
    desk.requests.receive(desk.pages[0], '{"do": "stop"}')


CASES = [
    run_child, wait_for_child, beat, run_program, start_foxglove, read_token, make_qr_code, note, log_in, send_goal,
    read_log, listen,
    break_part(page_requests, "read_request", ask),
    break_part(page_requests.PageRequests, "_carry_out", ask),
    break_part(foxglove, "ask_master", lambda _: foxglove.TopicServer(None).look()),
    break_part(requests.json, "loads", lambda _: requests.read_request("{}")),
    break_part(offers.Parameter, "check", lambda _: offers.check_values("go_to_goal", {"avoid": True})),
    break_part(programs.subprocess, "run", lambda _: programs.find_behaviors("~")),
    break_part(programs.roslib.packages, "find_node", lambda _: programs.find_programs()),
    break_part(programs.os, "scandir", lambda _: programs.measure("/")),
    break_part(access.ipaddress, "ip_address", lambda _: access.Access(None, []).admits_host("10.0.0.1")),
    break_part(client_limits.ipaddress, "ip_address", lambda _: client_limits.group_address("10.0.0.1")),
    break_part(feed, "find_lost_commands", lambda _: feed.FleetFeed._look_for_lost_commands(SimpleNamespace())),
    break_part(server.PageSocket, "write_message", lambda _: server.PageSocket.__new__(server.PageSocket).send("")),
]  # fmt: skip


@pytest.mark.parametrize("act", CASES, ids=lambda act: act.__name__)
def test_an_error_that_was_not_foreseen_is_not_taken_for_another(act, monkeypatch, tmp_path):
    with pytest.raises(UnforeseenError):
        act(monkeypatch, tmp_path)
