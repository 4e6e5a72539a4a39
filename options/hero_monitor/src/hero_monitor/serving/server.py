"""HTTP and one WebSocket per page (tornado): sends updates as JSON, receives requests. Knows nothing of ROS.

One thread owns all connections. No page can delay another: a slow page misses updates (every part is complete in
itself), and what cannot be sent at once takes 64 kB at most; what pages send is read in turns (FairStream).
"""

import contextlib
import itertools
import json
import logging
import secrets
import socket
import time
from collections import deque
from pathlib import Path
from typing import Any, Awaitable, Callable, Deque, Dict, List, NamedTuple, Optional, Tuple, Union

import tornado.httpserver
import tornado.ioloop
import tornado.iostream
import tornado.netutil
import tornado.platform.asyncio
import tornado.web
import tornado.websocket

from hero_node import TokenBuckets, make_printable

from ..fleet_feed.page_state import encode
from .access import Access
from .client_limits import ClientLimits, group_address
from .fair_stream import FairStream
from .lesson import VIEWER, User

WEB = Path(__file__).resolve().parents[1] / "web"
FILES = {path.relative_to(WEB).as_posix(): path for path in WEB.glob("**/*") if path.is_file()}
"""The page's files; no other is served."""

TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}

COOKIE = "hero_monitor"
SESSION_DAYS = 0.5
"""Lifetime of a login."""

CONTENT_SECURITY_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)

TOKEN_BURST = 5
TOKEN_PERIOD_S = 5.0
"""An address may try TOKEN_BURST wrong tokens at once, then one in TOKEN_PERIOD_S."""

PAGES_MAX = 200
"""With 20 robots they take a fifth of a core; a page that is slow misses updates."""

SEND_BUFFER = 65536
"""Bytes that the kernel may buffer for one page: about a second of a large swarm."""

WAITING_MAX = 5
"""Notices and acknowledgements kept for a slow page."""

PING_INTERVAL_S = 3.0
PING_TIMEOUT_S = 9.0
MAX_REQUEST_LENGTH = 16384
NAME_LENGTH_MAX = 30
"""Length limit of a user's name, characters."""

LISTEN_BACKLOG = 4096
"""As many as the kernel keeps by default (net.core.somaxconn): a connection that finds the queue full may be reset."""

EXPIRE_PERIOD_S = 1.0


class Actions(NamedTuple):
    """Callbacks of the server; all return at once."""

    open_page: Callable[["PageSocket"], None]
    receive: Callable[["PageSocket", Union[str, bytes]], None]
    close_page: Callable[[int], None]
    """Takes the page's number."""
    find_picture: Callable[[], bytes]


class BaseHandler(tornado.web.RequestHandler):
    """A request whose Host names this PC; every answer has headers that keep foreign content out."""

    access: Access
    limits: ClientLimits
    wrong_tokens: TokenBuckets
    actions: Actions
    pages: List["PageSocket"]

    def initialize(self, **shared: Any) -> None:
        """Set what all handlers share."""
        self.__dict__.update(shared)

    def set_default_headers(self) -> None:
        """Restrict the page to its own files and its own socket."""
        self.set_header("Content-Security-Policy", CONTENT_SECURITY_POLICY)
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("X-Frame-Options", "DENY")
        self.set_header("Referrer-Policy", "no-referrer")
        self.set_header("Cross-Origin-Resource-Policy", "same-origin")
        self.set_header("Cache-Control", "no-store")
        self.clear_header("Server")

    def prepare(self) -> Optional[Awaitable[None]]:
        """Refuse names that are not this PC's; trust the connection of a browser that is logged in."""
        if not self.access.admits_host(self.request.host_name):
            raise tornado.web.HTTPError(421)
        stream = getattr(self.request.connection, "stream", None)
        if self.is_logged_in and stream is not None:
            self.limits.trust(stream)
        return None

    def find_user(self) -> Optional[User]:
        """Return who makes the request; None for a browser that is not logged in."""
        cookie = self.get_secure_cookie(COOKIE, max_age_days=SESSION_DAYS)
        return self.access.find_user(None if cookie is None else cookie.decode())

    @property
    def is_logged_in(self) -> bool:
        """Return whether the browser has given the token or a code, or needs none."""
        return self.find_user() is not None

    @property
    def is_own_page(self) -> bool:
        """Return whether a page of this server makes the request; every browser sends Origin."""
        return self.access.admits_origin(self.request.headers.get("Origin"), self.request.host)

    def write_error(self, status_code: int, **others: Any) -> None:
        """Send one line that says what is wrong."""
        reasons = {
            403: "not allowed",
            404: "there is no such page",
            421: "not a name of this PC; see host_names in docs/monitor.md",
            429: "too many wrong tokens from this address; wait %d s" % TOKEN_PERIOD_S,
            503: "too many pages are open; to stop all robots: rosservice call /hero_driver/stop true",
        }
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(reasons.get(status_code, "error %d" % status_code) + "\n")


class FileHandler(BaseHandler):
    """The page's files, which hold nothing secret; the login page for browsers that are not logged in."""

    def get(self, name: str) -> None:
        """Send a file."""
        if not name:
            name = "index.html" if self.is_logged_in else "login.html"
        path = FILES.get(name)
        if path is None:
            raise tornado.web.HTTPError(404)
        self.set_header("Content-Type", TYPES.get(path.suffix, "text/plain") + "; charset=utf-8")
        self.finish(path.read_bytes())


class PictureHandler(BaseHandler):
    """The camera's picture, for browsers that are logged in."""

    def get(self) -> None:
        """Send the newest one."""
        if not self.is_logged_in:
            raise tornado.web.HTTPError(403)
        picture = self.actions.find_picture()
        if not picture:
            raise tornado.web.HTTPError(404)
        self.set_header("Content-Type", "image/jpeg")
        self.finish(picture)


class LoginHandler(BaseHandler):
    """Exchanges the token or a code for a signed cookie."""

    def post(self) -> None:
        """Check the token or code; keep the user's name."""
        if not self.is_own_page:
            raise tornado.web.HTTPError(403)
        try:
            fields = json.loads(self.request.body)
            token, name = fields["token"], str(fields.get("name", ""))
        except (ValueError, TypeError, KeyError, RecursionError):
            token = name = ""
        cookie = f"{self._find_key(token)} {make_printable(name)[:NAME_LENGTH_MAX].strip()}"
        self.set_secure_cookie(COOKIE, cookie, expires_days=None, httponly=True, samesite="Strict", path="/")
        self.set_status(204)

    def _find_key(self, token: Any) -> str:
        """Return the key for the cookie; refuse a wrong token or code, rate-limited per address. Raises: HTTPError."""
        address, now_s = group_address(self.request.remote_ip or ""), time.monotonic()
        if self.wrong_tokens.count(address, now_s) < 1.0:
            raise tornado.web.HTTPError(429)
        key = self.access.find_key(token) if isinstance(token, str) else ""
        if not key:
            self.wrong_tokens.take(address, 1.0, now_s)
            raise tornado.web.HTTPError(403)
        return key


class PageSocket(tornado.websocket.WebSocketHandler, BaseHandler):
    """The socket of one page."""

    numbers = itertools.count(1)

    def prepare(self) -> Optional[Awaitable[None]]:
        """Refuse pages of other servers, browsers that are not logged in, and pages beyond PAGES_MAX."""
        BaseHandler.prepare(self)
        if not (self.is_logged_in and self.is_own_page):
            raise tornado.web.HTTPError(403)
        if len(self.pages) >= PAGES_MAX:
            raise tornado.web.HTTPError(503)
        return None

    def check_origin(self, origin: str) -> bool:
        """Return whether a page of this server opens the socket."""
        return self.is_own_page

    def open(self, *arguments: str, **others: str) -> None:
        """Register a page."""
        self.number = next(PageSocket.numbers)
        self.seen: Dict[str, Any] = {}
        self.picture = False
        self.shown_user: Optional[User] = None
        self._sending: Any = None
        self._waiting: Deque[str] = deque(maxlen=WAITING_MAX)
        self.set_nodelay(True)
        stream = getattr(self.ws_connection, "stream", None)
        if stream is not None and stream.socket is not None:
            stream.socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        self.pages.append(self)
        self.actions.open_page(self)

    def on_message(self, message: Union[str, bytes]) -> None:
        """Pass a request on."""
        self.actions.receive(self, message)

    def on_close(self) -> None:
        """Unregister a page."""
        if self in self.pages:
            self.pages.remove(self)
            self.actions.close_page(self.number)

    @property
    def user(self) -> User:
        """User of the page; whose code was withdrawn may watch and stop."""
        return self.find_user() or User("", VIEWER)

    @property
    def who(self) -> str:
        """The user, for the log."""
        return self.user.describe(str(self.request.remote_ip))

    @property
    def ready(self) -> bool:
        """Return whether everything has been sent."""
        return self._sending is None or self._sending.done()

    def send(self, text: str) -> None:
        """Send a text to this page."""
        with contextlib.suppress(tornado.websocket.WebSocketClosedError):
            self._sending = self.write_message(text)
            self._sending.add_done_callback(lambda sent: sent.cancelled() or sent.exception())  # else asyncio logs it

    def tell(self, level: str, text: str) -> None:
        """Show a notice on this page."""
        self._send_when_ready({"notice": {"level": level, "text": text}})

    def acknowledge(self, request: str) -> None:
        """Tell the page that its request was received."""
        self._send_when_ready({"received": request})

    def end_hold(self, pressed_ms: float) -> None:
        """Tell the page that what it drives with this press stands until a new one."""
        self._send_when_ready({"hold_over": pressed_ms})

    def _send_when_ready(self, value: Dict[str, Any]) -> None:
        self._waiting.append(encode(value))
        self.send_waiting()

    def send_waiting(self) -> None:
        """Send what waits as soon as the page has received the rest; beyond WAITING_MAX the oldest are dropped."""
        while self._waiting and self.ready:
            self.send(self._waiting.popleft())


class MonotonicLoop(tornado.platform.asyncio.AsyncIOLoop):
    """tornado's loop, which becomes that of this thread. By the PC's clock, timers would pause when it is set back."""

    def time(self) -> float:
        """Return the time by which timers run, in s."""
        return time.monotonic()


class LimitedServer(tornado.httpserver.HTTPServer):
    """An HTTP server that asks the limits about every new connection."""

    limits: ClientLimits

    def handle_stream(self, stream: tornado.iostream.IOStream, address: Tuple[Any, ...]) -> None:
        """Serve a new connection, or close it."""
        fair = FairStream(stream.socket, max_buffer_size=stream.max_buffer_size)
        if self.limits.admit(fair, str(address[0]), time.monotonic()):
            super().handle_stream(fair, address)
        else:
            fair.close()


class Server:
    """The server, from its start to its end."""

    def __init__(self, access: Access, limits: ClientLimits, actions: Actions) -> None:
        # tornado logs each invalid request and cookie: any client could fill the disk.
        logging.getLogger("tornado.general").setLevel(logging.ERROR)
        self.pages: List[PageSocket] = []
        shared = {
            "access": access,
            "limits": limits,
            "wrong_tokens": TokenBuckets(TOKEN_BURST, 1.0 / TOKEN_PERIOD_S),
            "actions": actions,
            "pages": self.pages,
        }
        application = tornado.web.Application(
            [
                (r"/live", PageSocket, shared),
                (r"/login", LoginHandler, shared),
                (r"/picture/[0-9]{1,9}", PictureHandler, shared),
                (r"/(.*)", FileHandler, shared),
            ],
            log_function=lambda handler: None,  # logs no request: a URL may contain a secret by mistake
            cookie_secret=secrets.token_urlsafe(32),
            websocket_ping_interval=PING_INTERVAL_S,
            websocket_ping_timeout=PING_TIMEOUT_S,
            websocket_max_message_size=MAX_REQUEST_LENGTH,
        )
        self._http = LimitedServer(
            application, max_body_size=MAX_REQUEST_LENGTH, max_header_size=16384, idle_connection_timeout=60.0
        )
        self._http.limits = limits
        self._expiry = tornado.ioloop.PeriodicCallback(
            lambda: limits.expire(time.monotonic()), 1000.0 * EXPIRE_PERIOD_S
        )

    def listen(self, host: str, port: int) -> int:
        """Listen for pages; return the port. Raises: OSError."""
        sockets = tornado.netutil.bind_sockets(port, host, backlog=LISTEN_BACKLOG)
        self._http.add_sockets(sockets)
        self._expiry.start()
        return int(sockets[0].getsockname()[1])

    def close(self) -> None:
        """Disconnect all pages."""
        self._expiry.stop()
        self._http.stop()
        for page in list(self.pages):
            page.close(1001, "the monitor ends")
