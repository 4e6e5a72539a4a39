"""The socket of one page from its opening to its end, and what the server grants to each."""

import asyncio
import socket
from types import SimpleNamespace
from unittest.mock import Mock, call, create_autospec

import pytest
import tornado.web
import tornado.websocket

from hero_monitor.serving.access import Access
from hero_monitor.serving.client_limits import ClientLimits
from hero_monitor.serving.lesson import TEACHER, VIEWER, User
from hero_monitor.serving.server import FileHandler, PageSocket, Server


def make_page(pages, stream=None, **actions):
    page = PageSocket.__new__(PageSocket)
    page.pages, page.ws_connection, page.set_nodelay = pages, SimpleNamespace(stream=stream), Mock()
    page.actions = SimpleNamespace(**actions)
    return page


def test_a_page_is_known_with_all_it_has_while_it_is_open():
    pages, opened, received, closed = [], [], [], []

    def open_page(page):
        opened.append((list(pages), page.ready, page.picture, page.shown_user, page.seen, page._waiting.maxlen))

    connection = create_autospec(socket.socket, instance=True)
    actions = {
        "open_page": open_page,
        "receive": lambda *got: received.append(got),
        "close_page": lambda number: closed.append((number, list(pages))),
    }
    streams = SimpleNamespace(socket=connection), SimpleNamespace(socket=None), None
    first, second, third = (make_page(pages, stream, **actions) for stream in streams)
    for page in (first, second, third):
        page.open()
        page.set_nodelay.assert_called_once_with(True)
    connection.setsockopt.assert_called_once_with(socket.SOL_SOCKET, socket.SO_SNDBUF, 65536)
    fresh = True, False, None, {}, 5
    assert opened == [([first], *fresh), ([first, second], *fresh), ([first, second, third], *fresh)]
    assert third.number == second.number + 1 == first.number + 2
    second.on_message("text")
    second.on_close()
    assert received == [(second, "text")] and closed == [(second.number, [first, third])]


def test_what_a_page_that_left_was_sent_disturbs_no_one():
    page, sent = make_page([]), []
    page.write_message = lambda text: sent.append(text) or SimpleNamespace(add_done_callback=sent.append)
    page.send("first")
    text, forget = sent
    cancelled = create_autospec(asyncio.Future, instance=True)
    cancelled.cancelled.return_value, cancelled.exception.side_effect = True, asyncio.CancelledError
    failed = create_autospec(asyncio.Future, instance=True)
    failed.cancelled.return_value = False
    for future in (cancelled, failed):
        forget(future)
    assert text == "first" and failed.exception.called, "else asyncio would log it"
    page.write_message = Mock(side_effect=tornado.websocket.WebSocketClosedError)
    page.send("second")


def test_whose_code_was_withdrawn_watches_on():
    page = make_page([])
    page.request = SimpleNamespace(remote_ip="10.42.0.7")
    page.find_user = lambda: User("Ada", TEACHER)
    assert page.user == User("Ada", TEACHER) and page.who == "Ada (teacher), 10.42.0.7"
    page.find_user = lambda: None
    assert page.user == User("", VIEWER) and page.who == "a viewer, 10.42.0.7"


@pytest.mark.parametrize(
    ("host", "user"), [("pc", User("", VIEWER)), ("pc", None), ("evil.example", User("", TEACHER))]
)
def test_only_connections_of_those_who_are_logged_in_last(host, user):
    page = FileHandler.__new__(FileHandler)
    page.access, page.limits = Access(None, ["pc"]), create_autospec(ClientLimits, instance=True)
    page.request = SimpleNamespace(host_name=host, connection=SimpleNamespace(stream="a stream"))
    page.find_user = lambda: user
    if host == "pc":
        page.prepare()
        assert page.limits.trust.call_args_list == [call("a stream")] * bool(user)
    else:
        with pytest.raises(tornado.web.HTTPError, match="421"):
            page.prepare()
        assert not page.limits.trust.called
    page.request.connection = None  # of a connection that is closed already
    if host == "pc":
        page.prepare()


def test_a_login_of_one_server_is_none_of_another_and_browsers_are_pinged():
    one, other = (Server(Access(None, []), ClientLimits(9), Mock())._http.request_callback.settings for _ in range(2))
    limits = {"websocket_ping_interval": 3.0, "websocket_ping_timeout": 9.0, "websocket_max_message_size": 16384}
    assert {name: one[name] for name in limits} == limits
    assert len(one["cookie_secret"]) >= 43 and one["cookie_secret"] != other["cookie_secret"], "32 bytes, drawn anew"
    assert one["log_function"](None) is None, "a URL may hold a secret by mistake"
