"""Pieces of JSON and requests -> HTTP and one WebSocket per page, with tornado. Knows nothing of ROS.

One thread owns all connections. Nothing that a page does can hold up another: a page that is slow misses frames
instead of making them wait (every piece is whole in itself), and what cannot be sent at once takes 64 kB at most.
"""

import itertools
import json
import mimetypes
import socket
import time
from collections import deque
from pathlib import Path
from typing import Any, Awaitable, Callable, Deque, Dict, List, NamedTuple, Optional, Union

import tornado.gen
import tornado.httpserver
import tornado.ioloop
import tornado.netutil
import tornado.web
import tornado.websocket

from .access import Access
from .sections import Page, encode

WEB = Path(__file__).resolve().parent / "web"
COOKIE = "hero_monitor"
PAGES_MAX = 30
SEND_BUFFER = 65536
"""Bytes that the system may hold back for one page: about a second of a large swarm."""

NOTICES_KEPT = 5
WRONG_TOKEN_PAUSE_S = 1.0
LOGINS_AT_ONCE = 5
PING_INTERVAL_S = 3.0
PING_TIMEOUT_S = 9.0
LONGEST_REQUEST = 4096


class Actions(NamedTuple):
    """What the server asks of the rest; all return at once."""

    open_page: Callable[["LivePage"], None]
    receive: Callable[["LivePage", Union[str, bytes]], None]
    close_page: Callable[["LivePage"], None]


class Checked(tornado.web.RequestHandler):
    """A request whose Host names this machine; everything carries headers that keep foreign content out."""

    access: Access

    def initialize(self, access: Access, **others: Any) -> None:
        """Take what all handlers share."""
        self.access = access
        for name, value in others.items():
            setattr(self, name, value)

    def set_default_headers(self) -> None:
        """Forbid the page everything but its own files and its own socket."""
        host = self.request.headers.get("Host", "")
        # Named, too, because browsers before 2022 do not count ws: as 'self'.
        socket_host = host if self.access_admits(host) else ""
        self.set_header(
            "Content-Security-Policy",
            "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
            "connect-src 'self' ws://%s wss://%s; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
            % (socket_host, socket_host)
            if socket_host
            else "default-src 'none'",
        )
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("X-Frame-Options", "DENY")
        self.set_header("Referrer-Policy", "no-referrer")
        self.set_header("Cross-Origin-Resource-Policy", "same-origin")
        self.set_header("Cache-Control", "no-store")
        self.clear_header("Server")

    def access_admits(self, host: str) -> bool:
        """Whether the Host is one of ours; asked before initialize() as well."""
        access = getattr(self, "access", None)
        return access is not None and access.admits_host(host)

    def prepare(self) -> Optional[Awaitable[None]]:
        """Refuse names that are not this machine's."""
        self.set_default_headers()
        if not self.access.admits_host(self.request.headers.get("Host", "")):
            raise tornado.web.HTTPError(421)
        return None

    @property
    def known(self) -> bool:
        """Whether the browser has given the token, or needs none."""
        return self.access.admits_session(self.get_cookie(COOKIE), time.monotonic())

    def write_error(self, status_code: int, **others: Any) -> None:
        """Say in one line what is wrong."""
        reasons = {
            403: "not allowed",
            404: "there is no such page",
            421: "this name is not one of this machine's; see host_names in docs/monitor.md",
            429: "too many tries; wait a moment",
            503: "too many pages are open",
        }
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(reasons.get(status_code, "error %d" % status_code) + "\n")


class FileHandler(Checked):
    """The page's own files, which hold nothing secret; the page itself only for those that may see it."""

    def get(self, name: str) -> None:
        """Send a file."""
        if not name:
            name = "index.html" if self.known else "login.html"
        path = WEB / name
        if "/" in name or not path.is_file():
            raise tornado.web.HTTPError(404)
        kind = {".js": "text/javascript", ".svg": "image/svg+xml"}.get(path.suffix)
        kind = kind or mimetypes.guess_type(name)[0] or "application/octet-stream"
        self.set_header("Content-Type", kind + "; charset=utf-8")
        self.finish(path.read_bytes())


class LoginHandler(Checked):
    """The token, in exchange for a cookie."""

    waiting = 0

    async def post(self) -> None:
        """Check the token; a wrong one costs a second."""
        if not self.access.admits_origin(self.request.headers.get("Origin"), self.request.host):
            raise tornado.web.HTTPError(403)
        if LoginHandler.waiting >= LOGINS_AT_ONCE:
            raise tornado.web.HTTPError(429)
        try:
            token = json.loads(self.request.body)["token"]
        except (ValueError, TypeError, KeyError, RecursionError):
            token = None
        session = self.access.log_in(token, time.monotonic()) if isinstance(token, str) else None
        if session is None:
            LoginHandler.waiting += 1
            try:
                await tornado.gen.sleep(WRONG_TOKEN_PAUSE_S)
            finally:
                LoginHandler.waiting -= 1
            raise tornado.web.HTTPError(403)
        self.set_cookie(COOKIE, session, httponly=True, samesite="Strict", path="/")
        self.set_status(204)


class LivePage(tornado.websocket.WebSocketHandler, Checked):
    """The socket of one page."""

    numbers = itertools.count(1)
    actions: Actions
    pages: List["LivePage"]

    def prepare(self) -> Optional[Awaitable[None]]:
        """Refuse who may not see the fleet, and one page too many."""
        Checked.prepare(self)
        if not self.known:
            raise tornado.web.HTTPError(403)
        if len(self.pages) >= PAGES_MAX:
            raise tornado.web.HTTPError(503)
        return None

    def check_origin(self, origin: str) -> bool:
        """Refuse pages of other servers."""
        return self.access.admits_origin(origin, self.request.host)

    async def get(self, *arguments: Any, **others: Any) -> None:
        """Refuse those that say no Origin, which tornado lets in: every browser says it."""
        if not self.access.admits_origin(self.request.headers.get("Origin"), self.request.host):
            raise tornado.web.HTTPError(403)
        await super().get(*arguments, **others)

    def open(self, *arguments: str, **others: str) -> None:
        """A page is there."""
        self.number = next(LivePage.numbers)
        self.seen = Page()
        self.truth = False
        self._sending: Optional[Awaitable[None]] = None
        self._notices: Deque[str] = deque(maxlen=NOTICES_KEPT)
        self.set_nodelay(True)
        if self.ws_connection is not None:
            stream = getattr(self.ws_connection, "stream", None)
            if stream is not None and stream.socket is not None:
                stream.socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        self.pages.append(self)
        self.actions.open_page(self)

    def on_message(self, message: Union[str, bytes]) -> None:
        """A page wants something."""
        self.actions.receive(self, message)

    def on_close(self) -> None:
        """A page is gone."""
        if self in self.pages:
            self.pages.remove(self)
            self.actions.close_page(self)

    @property
    def ready(self) -> bool:
        """Whether everything that was sent has left."""
        return self._sending is None or self._sending.done()  # type: ignore[attr-defined]

    def send(self, text: str) -> None:
        """Send a text to this page."""
        try:
            self._sending = self.write_message(text)
        except tornado.websocket.WebSocketClosedError:
            return

    def tell(self, level: str, text: str) -> None:
        """Show a line to the people at this page."""
        self._notices.append(encode({"notice": {"level": level, "text": text}}))
        self.send_notices()

    def send_notices(self) -> None:
        """Send the lines that wait, where the page is quick enough; of those that are too many the oldest are lost."""
        while self._notices and self.ready:
            self.send(self._notices.popleft())


class Server:
    """The server, from its start to its end."""

    def __init__(self, access: Access, actions: Actions) -> None:
        self.pages: List[LivePage] = []
        shared: Dict[str, Any] = {"access": access}
        self._application = tornado.web.Application(
            [
                (r"/live", LivePage, {**shared, "actions": actions, "pages": self.pages}),
                (r"/login", LoginHandler, shared),
                (r"/([a-z_.]*)", FileHandler, shared),
            ],
            default_handler_class=NotFoundHandler,
            default_handler_args=shared,
            log_function=ignore_request,
            websocket_ping_interval=PING_INTERVAL_S,
            websocket_ping_timeout=PING_TIMEOUT_S,
            websocket_max_message_size=LONGEST_REQUEST,
        )
        self._http = tornado.httpserver.HTTPServer(
            self._application,
            max_body_size=LONGEST_REQUEST,
            max_header_size=16384,
            idle_connection_timeout=60.0,
        )

    def listen(self, host: str, port: int) -> int:
        """Await pages; return the port. Raises: OSError."""
        sockets = tornado.netutil.bind_sockets(port, host)
        self._http.add_sockets(sockets)
        return int(sockets[0].getsockname()[1])

    def close(self) -> None:
        """Send all pages away."""
        self._http.stop()
        for page in list(self.pages):
            page.close(1001, "the monitor ends")


class NotFoundHandler(Checked):
    """Every other path."""

    def get(self) -> None:
        """There is nothing."""
        raise tornado.web.HTTPError(404)


def ignore_request(handler: tornado.web.RequestHandler) -> None:
    """Requests are not logged: an address may be typed with a secret in it."""
