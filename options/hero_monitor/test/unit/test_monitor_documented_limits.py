"""Limits are those of the documents, and hold where they are used."""

import re
from pathlib import Path
from types import SimpleNamespace
from unittest import mock

import pytest
import tornado.httputil
import tornado.ioloop
import tornado.web

from hero_monitor.control import guard
from hero_monitor.control.dead_man import DeadMan
from hero_monitor.control.drive_requests import DriveRequests
from hero_monitor.control.programs import Programs
from hero_monitor.fleet_feed.feed import FleetFeed
from hero_monitor.page_requests import INERT_S
from hero_monitor.program import Monitor
from hero_monitor.serving.access import TOKEN_LENGTH_MIN, Access
from hero_monitor.serving.client_limits import ClientLimits
from hero_monitor.serving.server import COOKIE, PAGES_MAX, BaseHandler, MonotonicLoop, Server

END_CHECK_PERIOD_S = 0.2

DOCS = Path(__file__).resolve().parents[4] / "docs"
README = Path(__file__).resolve().parents[2] / "README.md"
NUMBERS = {"five": 5}
TOKEN = "a secret of more than sixteen letters"
NOW_S = 1.8e9


def find_limits(page, pattern):
    """Return the numbers of a sentence that a page holds once."""
    (found,) = re.finditer(pattern, " ".join(page.read_text(encoding="utf-8").split()))
    return [float(NUMBERS.get(text, text)) for text in found.groups()]


MONITOR, SECURITY = DOCS / "monitor.md", DOCS / "security.md"


def test_limits_are_those_of_the_document():
    for page, pattern, limits in (
        (MONITOR, r"(\w+) pages can be open at once", [PAGES_MAX]),
        (MONITOR, r"is killed, or hangs for (\d+) s", [guard.SILENT_POLLS * guard.POLL_S]),
        (MONITOR, r"(\d+) s after a stop at the earliest", [INERT_S]),
        (README, r"token for the login, (\d+) characters or more", [TOKEN_LENGTH_MIN]),
    ):
        assert find_limits(page, pattern) == limits, pattern


def test_silence_for_the_documented_time_stops_a_robot_that_is_driven():
    (silence_s,) = find_limits(MONITOR, r"the connection breaks or is silent for ([\d.]+) s")
    dead_man = DeadMan()
    for robot in ("hero_0", "hero_7"):
        assert dead_man.hold(1, robot, now_s=10.0)
    dead_man.hold(1, "hero_7", now_s=10.2)
    assert dead_man.take_stops(10.0 + silence_s - 0.01) == []
    assert dead_man.take_stops(10.0 + silence_s + 0.01) == ["hero_0"]


class Handler(BaseHandler):
    """A request of a browser with a login of some age."""

    def __init__(self, monkeypatch, age_s):
        application = tornado.web.Application(cookie_secret="secret")
        monkeypatch.setattr(tornado.web, "time", SimpleNamespace(time=lambda: NOW_S))
        value = tornado.web.create_signed_value("secret", COOKIE, "token", clock=lambda: NOW_S - age_s)
        headers = tornado.httputil.HTTPHeaders({"Cookie": f"{COOKIE}={value.decode()}"})
        request = tornado.httputil.HTTPServerRequest(method="GET", uri="/", headers=headers, connection=mock.Mock())
        super().__init__(application, request, access=Access(TOKEN, []))


def test_a_login_ends_after_the_documented_time(monkeypatch):
    (lasts_h,) = find_limits(MONITOR, r"A login lasts (\d+) hours")
    assert Handler(monkeypatch, 3600.0 * lasts_h - 1.0).is_logged_in
    assert not Handler(monkeypatch, 3600.0 * lasts_h + 1.0).is_logged_in


class Connection:
    is_closed = False

    def close(self):
        self.is_closed = True

    def closed(self):
        return self.is_closed


def test_connections_without_login_have_the_documented_limits():
    count, lasts_s = find_limits(SECURITY, r"without login limited to (\d+) per address and (\d+) s")
    limits = ClientLimits(400)
    connections = [Connection() for _ in range(int(count) + 1)]
    assert all(limits.admit(connection, "10.0.0.2", 5.0) for connection in connections)
    assert [connection.is_closed for connection in connections] == [True] + [False] * int(count)
    limits.trust(connections[-1])
    limits.expire(5.0 + lasts_s)
    assert not any(connection.is_closed for connection in connections[1:])
    limits.expire(5.1 + lasts_s)
    assert [connection.is_closed for connection in connections] == [True] * int(count) + [False]


def test_an_address_has_the_documented_number_of_wrong_tokens():
    count, period_s = find_limits(SECURITY, r"after (\w+), one per (\d+) s and address")
    server = Server(Access(TOKEN, []), ClientLimits(400), SimpleNamespace())
    request = tornado.httputil.HTTPServerRequest(method="POST", uri="/login", connection=mock.Mock())
    tokens = server._http.request_callback.find_handler(request).handler_kwargs["wrong_tokens"]
    assert [tokens.take("10.0.0.2", 1.0, 100.0) for _ in range(int(count) + 1)] == [True] * int(count) + [False]
    assert not tokens.take("10.0.0.2", 1.0, 99.9 + period_s)
    assert tokens.take("10.0.0.2", 1.0, 100.1 + period_s)


@pytest.fixture(name="monitor")
def make_monitor():
    monitor = Monitor.__new__(Monitor)  # without a server and a ROS node
    monitor._server, monitor._resting = SimpleNamespace(pages=["another"]), None
    monitor._commander = mock.create_autospec(DriveRequests, instance=True, dead_man=mock.create_autospec(DeadMan))
    monitor._loop = mock.create_autospec(MonotonicLoop, instance=True)
    monitor._programs = mock.create_autospec(Programs, instance=True)
    monitor._feed = mock.create_autospec(FleetFeed, instance=True)
    calls = [mock.create_autospec(tornado.ioloop.PeriodicCallback, instance=True) for _ in range(2)]
    monitor._repeated = calls
    return monitor


def test_programs_end_the_documented_time_after_the_last_page(monitor):
    (linger_s,) = find_limits(MONITOR, r"after (\d+) s without an open page")
    monitor._leave(4)
    assert not monitor._loop.call_later.called
    monitor._server.pages.clear()
    monitor._leave(1)
    monitor._loop.call_later.assert_called_once_with(pytest.approx(linger_s), monitor._rest)
    monitor._leave(2)
    monitor._loop.call_later.assert_called_once()
    assert monitor._commander.dead_man.drop_page.call_args_list == [mock.call(4), mock.call(1), mock.call(2)]


def test_a_page_that_comes_back_in_time_keeps_programs_running(monitor):
    running, resting = monitor._repeated
    running.is_running.return_value, resting.is_running.return_value = True, False
    monitor._enter("a page")
    assert not monitor._loop.remove_timeout.called and not running.start.called and resting.start.called
    monitor._server.pages.clear()
    monitor._leave(1)
    monitor._enter("the page")
    monitor._loop.remove_timeout.assert_called_once_with(monitor._loop.call_later.return_value)
    monitor._leave(2)
    assert monitor._loop.call_later.call_count == 2, "its time begins anew"


def test_without_pages_programs_end_and_then_nothing_is_read_any_more(monitor):
    monitor._resting = "the timer that calls"
    monitor._programs.end_all.side_effect = [True, True, False]
    for _ in range(2):
        monitor._rest()
        monitor._loop.call_later.assert_called_with(END_CHECK_PERIOD_S, monitor._rest)
        assert monitor._resting is monitor._loop.call_later.return_value
    assert not monitor._feed.update_subscriptions.called
    monitor._rest()
    assert monitor._loop.call_later.call_count == 2 and monitor._resting is None
    assert [repeated.stop.call_count for repeated in monitor._repeated] == [1, 1]
    monitor._feed.update_subscriptions.assert_called_once_with(has_pages=False, picture=False)
