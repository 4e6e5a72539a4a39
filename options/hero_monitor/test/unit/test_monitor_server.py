"""What the server answers to requests, without a network."""

import asyncio
import json
import logging
import socket
from unittest import mock

import pytest
import tornado.httputil
import tornado.web
from tornado.http1connection import HTTP1Connection
from tornado.httpserver import HTTPServer
from tornado.iostream import IOStream

from hero_monitor.serving import server as server_module
from hero_monitor.serving.access import Access
from hero_monitor.serving.client_limits import ClientLimits
from hero_monitor.serving.lesson import Lesson
from hero_monitor.serving.server import FileHandler, LoginHandler, PageSocket, PictureHandler, Server

PAGES_MAX = 200

TOKEN = "a secret of more than sixteen letters"
OURS = {"Origin": "http://localhost"}
ASKS_TO_UPGRADE = 426
"""The answer to one that is let in, because it names no version of the protocol."""


def ask(
    handler_class, *arguments, headers=(), host="localhost", token=None, method="GET", body=b"", address="::1", **values
):
    """Return status, headers and text of the answer to a request."""
    connection, written = mock.create_autospec(HTTP1Connection, instance=True), []

    def write_headers(start_line, answered, chunk=None, **_more):  # Tornado 5 gives a callback, too
        written.append((start_line.code, answered.copy(), (chunk or b"").decode()))

    connection.write_headers.side_effect = write_headers
    all_headers = tornado.httputil.HTTPHeaders({"Host": host, **dict(headers)})
    request = tornado.httputil.HTTPServerRequest(
        method=method, uri="/", host=host, headers=all_headers, body=body, connection=connection
    )
    request.remote_ip = address
    application = tornado.web.Application(cookie_secret="secret")
    handler = handler_class(application, request, access=Access(token, []), limits=ClientLimits(400), **values)

    async def execute():
        await handler._execute([], *arguments)

    asyncio.run(execute())
    return written[-1]


def ask_for_socket(pages=0, headers=OURS, **options):
    headers = {"Upgrade": "websocket", "Connection": "Upgrade", **headers}
    return ask(PageSocket, headers=headers, actions=None, pages=[None] * pages, **options)


@pytest.mark.parametrize("pages", [PAGES_MAX, PAGES_MAX + 1])
def test_a_page_beyond_the_limit_is_told_how_to_stop_all_robots(pages):
    status, _, text = ask_for_socket(pages)
    assert status == 503
    assert text == "too many pages are open; to stop all robots: rosservice call /hero_driver/stop true\n"
    assert ask_for_socket(PAGES_MAX - 1)[0] == ASKS_TO_UPGRADE


def test_only_our_own_page_may_open_a_socket():
    assert ask_for_socket()[0] == ASKS_TO_UPGRADE
    assert ask_for_socket(token=TOKEN)[0] == 403
    assert ask_for_socket(headers={})[0] == 403
    assert ask_for_socket(headers={"Origin": "http://evil.example"})[0] == 403
    status, _, text = ask_for_socket(host="evil.example")
    assert status == 421
    assert "host_names" in text


def test_every_answer_keeps_foreign_content_out():
    answers = [ask(FileHandler, "style.css"), ask(FileHandler, "../server.py"), ask_for_socket(PAGES_MAX)]
    for status, headers, _ in answers:
        assert status in (200, 404, 503)
        assert headers["Content-Security-Policy"].startswith("default-src 'none'; script-src 'self';")
        assert headers["X-Frame-Options"] == "DENY"
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert headers["Referrer-Policy"] == "no-referrer" and headers["Cross-Origin-Resource-Policy"] == "same-origin"
        assert headers["Cache-Control"] == "no-store"
        assert "Server" not in headers


def test_files_are_sent_with_their_types_and_no_others():
    for name, kind in [("main.js", "text/javascript"), ("icon.svg", "image/svg+xml"), ("style.css", "text/css")]:
        status, headers, text = ask(FileHandler, name)
        assert (status, headers["Content-Type"]) == (200, kind + "; charset=utf-8")
        assert text
    assert ask(FileHandler, "server.py")[::2] == (404, "there is no such page\n")
    page, login = ask(FileHandler, "")[2], ask(FileHandler, "", token=TOKEN)[2]
    assert 'id="stop"' in page
    assert 'id="stop"' not in login


def test_the_picture_is_for_those_who_are_logged_in():
    actions = mock.Mock(find_picture=lambda: b"jpeg")
    status, headers, text = ask(PictureHandler, actions=actions)
    assert (status, headers["Content-Type"], text) == (200, "image/jpeg", "jpeg")
    assert ask(PictureHandler, actions=actions, token=TOKEN)[::2] == (403, "not allowed\n")
    actions.find_picture = bytes
    assert ask(PictureHandler, actions=actions)[0] == 404


def test_a_server_listens_asks_its_limits_and_closes_its_pages(monkeypatch, clock):
    sockets = [mock.create_autospec(socket.socket, instance=True)]
    sockets[0].getsockname.return_value = ("0.0.0.0", 40123)
    bind = mock.create_autospec(tornado.netutil.bind_sockets, return_value=sockets)
    monkeypatch.setattr(server_module.tornado.netutil, "bind_sockets", bind)
    callbacks = mock.create_autospec(tornado.ioloop.PeriodicCallback)
    monkeypatch.setattr(server_module.tornado.ioloop, "PeriodicCallback", callbacks)
    for name in ("add_sockets", "stop", "handle_stream"):
        monkeypatch.setattr(HTTPServer, name, mock.create_autospec(getattr(HTTPServer, name)))
    limits = mock.create_autospec(ClientLimits, instance=True)
    server = Server(Access(TOKEN, []), limits, mock.Mock())
    params = server._http.conn_params
    assert (params.max_header_size, params.max_body_size, params.header_timeout) == (16384, 16384, 60.0)
    assert server.listen("0.0.0.0", 0) == 40123
    bind.assert_called_once_with(0, "0.0.0.0", backlog=server_module.LISTEN_BACKLOG)
    HTTPServer.add_sockets.assert_called_once_with(server._http, sockets)
    expire, period_ms = callbacks.call_args[0]
    assert period_ms == 1000.0 and callbacks.return_value.start.called and not limits.expire.called
    expire()
    limits.expire.assert_called_once_with(1000.0)

    fair = mock.create_autospec(server_module.FairStream, instance=True)
    make = mock.create_autospec(server_module.FairStream, return_value=fair)
    monkeypatch.setattr(server_module, "FairStream", make)
    stream = mock.create_autospec(IOStream, instance=True, socket="socket", max_buffer_size=7)
    for is_admitted in (False, True):
        limits.admit.return_value = is_admitted
        server._http.handle_stream(stream, ("10.0.0.2", 50000))
        limits.admit.assert_called_with(fair, "10.0.0.2", 1000.0)
        assert fair.close.call_count == 1 and HTTPServer.handle_stream.called == is_admitted
    make.assert_called_with("socket", max_buffer_size=7)
    HTTPServer.handle_stream.assert_called_once_with(server._http, fair, ("10.0.0.2", 50000))

    server.pages += [mock.create_autospec(PageSocket, instance=True) for _ in range(3)]
    for page in server.pages:
        page.close.side_effect = lambda *_, page=page: server.pages.remove(page)
    pages = list(server.pages)
    server.close()
    assert callbacks.return_value.stop.called and HTTPServer.stop.called
    assert [page.close.call_args[0] for page in pages] == [(1001, "the monitor ends")] * 3


RIGHT = json.dumps({"token": TOKEN})


def make_login(headers=OURS):
    """Return a function that sends a login with this body from an address, to a server of its own."""
    login = tornado.httputil.HTTPServerRequest(method="POST", uri="/login", connection=mock.Mock())
    server = Server(Access(TOKEN, []), ClientLimits(400), mock.Mock())
    tokens = server._http.request_callback.find_handler(login).handler_kwargs["wrong_tokens"]
    fixed = {"headers": headers, "method": "POST", "token": TOKEN, "wrong_tokens": tokens}
    return lambda body, address="10.0.0.2": ask(LoginHandler, body=body.encode(), address=address, **fixed)


def test_requests_of_clients_fill_no_disk_with_warnings():
    logger = logging.getLogger("tornado.general")  # warns of each invalid request and cookie
    logger.setLevel(logging.NOTSET)
    Server(Access(TOKEN, []), ClientLimits(400), mock.Mock())
    assert not logger.isEnabledFor(logging.WARNING) and logger.isEnabledFor(logging.ERROR)


@pytest.fixture(name="clock")
def make_clock(monkeypatch):
    clock = mock.Mock()
    monkeypatch.setattr(server_module, "time", clock)
    clock.monotonic.return_value = 1000.0
    return clock.monotonic


@pytest.mark.usefixtures("clock")
@pytest.mark.parametrize("body", ["{", "[]", "{}", '{"token": 1}', '{"token": "wrong"}', "[" * 100000])
def test_wrong_tokens_are_refused_and_counted(body):
    assert make_login({"Origin": "http://evil.example"})(RIGHT)[0] == make_login({})(RIGHT)[0] == 403
    log_in = make_login()
    status, headers, _ = log_in(RIGHT)
    assert status == 204
    assert "HttpOnly" in headers["Set-Cookie"]
    assert "SameSite=Strict" in headers["Set-Cookie"]
    assert "expires" not in headers["Set-Cookie"], "it ends with the browser"
    assert [log_in(body)[0] for _ in range(5)] == [403] * 5
    status, headers, text = log_in(RIGHT)
    assert status == 429
    assert "Set-Cookie" not in headers
    assert "wait 5 s" in text


def test_too_many_wrong_tokens_make_their_address_wait_and_no_other(clock):
    log_in = make_login()
    assert [log_in("wrong")[0] for _ in range(6)] == [403] * 5 + [429]
    assert log_in("wrong", "10.0.0.1")[0] == 403 and log_in("wrong", "::ffff:10.0.0.2")[0] == 429
    for waited_s, status in ((4.9, 429), (5.1, 204)):
        clock.return_value = 1000.0 + waited_s
        assert log_in(RIGHT)[0] == status


def test_an_address_that_waited_long_has_no_more_tries_than_a_new_one(clock):
    log_in = make_login()
    assert log_in("wrong")[0] == 403
    clock.return_value = 2000.0
    assert [log_in("wrong")[0] for _ in range(6)] == [403] * 5 + [429]


def test_a_code_of_the_lesson_lets_a_phone_in_under_its_name(monkeypatch, clock):
    lesson = Lesson()
    access = Access(TOKEN, [], lesson)
    monkeypatch.setattr("test_monitor_server.Access", lambda *given: access)
    log_in = make_login()
    status, headers, _ = log_in(json.dumps({"token": lesson.class_code, "name": "Ada\n" + "x" * 99}))
    assert status == 204
    value = headers["Set-Cookie"].partition("=")[2].partition(";")[0].strip('"')
    cookie = tornado.web.decode_signed_value("secret", server_module.COOKIE, value).decode()
    key, _, name = cookie.partition(" ")
    assert key == lesson.class_code and name.isprintable() and len(name) <= server_module.NAME_LENGTH_MAX
    assert [log_in('{"token": "000"}')[0] for _ in range(6)] == [403] * 5 + [429]
    assert log_in(json.dumps({"token": lesson.class_code}))[0] == 429, "guessing is rate-limited as with tokens"
