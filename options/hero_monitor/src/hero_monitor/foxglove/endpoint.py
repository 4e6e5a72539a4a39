"""The WebSocket /foxglove: one connection per client, with the access rules of the page."""

import contextlib
from typing import TYPE_CHECKING, Any, Awaitable, FrozenSet, List, Optional, Sequence, Set, Union

import tornado.ioloop
import tornado.iostream
import tornado.web
import tornado.websocket

from ..serving.lesson import User
from ..serving.server import BaseHandler, Route
from .hub import Client, Hub
from .protocol import SUBPROTOCOLS

if TYPE_CHECKING:
    from .ros_topics import RosTopics

CLIENTS_MAX = 10
FLUSH_PERIOD_S = 0.02
MAX_REQUEST_LENGTH = 1_000_000
"""A subscription to each of ten thousand topics."""


class FoxgloveSocket(tornado.websocket.WebSocketHandler, BaseHandler):
    """The socket of one client."""

    endpoint: "FoxgloveEndpoint"
    origins: FrozenSet[str]

    def prepare(self) -> Optional[Awaitable[None]]:
        """Refuse foreign pages, clients without the token (cookie, or ?token=), and those beyond CLIENTS_MAX."""
        self._key = ""
        origin = self.request.headers.get("Origin")
        # Programs send none. Browsers always do, whatever page they show.
        if origin and not self.check_origin(origin):
            raise tornado.web.HTTPError(403)
        if not self.is_logged_in:
            self._key = self.check_token(self.get_query_argument("token", ""))
        BaseHandler.prepare(self)
        offered = self.request.headers.get("Sec-WebSocket-Protocol", "").split(",")
        if not {name.strip() for name in offered} & set(SUBPROTOCOLS):
            raise tornado.web.HTTPError(400)
        if len(self.endpoint.hub.clients) >= CLIENTS_MAX:
            raise tornado.web.HTTPError(503)
        return None

    def find_user(self) -> Optional[User]:
        return self.access.find_user(self._key) if self._key else super().find_user()

    def check_origin(self, origin: str) -> bool:
        """Return whether a page may connect: this server's, and those that a parameter names."""
        return origin.lower() in self.origins or self.access.admits_origin(origin, self.request.host)

    @property
    def max_message_size(self) -> int:
        """The longest request, in bytes."""
        return MAX_REQUEST_LENGTH

    def select_subprotocol(self, subprotocols: List[str]) -> Optional[str]:
        """Return the newest that the client offers."""
        return next((name for name in SUBPROTOCOLS if name in subprotocols), None)

    def open(self, *arguments: str, **others: str) -> None:
        """Greet a client."""
        self._sending: Any = None
        self.set_nodelay(True)
        self.client = Client(self._write)
        self.endpoint.add(self)

    def on_message(self, message: Union[str, bytes]) -> None:
        """Pass a request on."""
        self.endpoint.hub.receive(self.client, message)

    def on_close(self) -> None:
        """Forget a client."""
        self.endpoint.remove(self)

    def send_waiting(self) -> None:
        """Send what waits, unless the client is still receiving the last of it."""
        stream = getattr(self.ws_connection, "stream", None)
        if stream is None or not (self._sending is None or self._sending.done()):
            return
        frames = self.client.take()
        if frames:
            # One write for all: tornado's write_message() takes longer for each frame than all else that it passes.
            with contextlib.suppress(tornado.iostream.StreamClosedError):
                self._sending = stream.write(b"".join(frames))

    def _write(self, text: str) -> None:
        with contextlib.suppress(tornado.websocket.WebSocketClosedError):
            self.write_message(text)


class FoxgloveEndpoint:
    """All clients; topics are looked up and subscribed to only while there is one."""

    def __init__(self, source: "RosTopics", origins: Sequence[str]) -> None:
        """origins: of other servers whose pages may connect."""
        self.hub = Hub()
        self._source = source
        self._sockets: Set[FoxgloveSocket] = set()
        self._tick = tornado.ioloop.PeriodicCallback(self._update, 1000.0 * FLUSH_PERIOD_S)
        values = {"endpoint": self, "origins": frozenset(origin.lower() for origin in origins)}
        self.route: Route = (r"/foxglove/?", FoxgloveSocket, values)

    def add(self, socket: FoxgloveSocket) -> None:
        """Serve a client."""
        self._sockets.add(socket)
        self.hub.add(socket.client)
        if not self._tick.is_running():
            self._tick.start()

    def remove(self, socket: FoxgloveSocket) -> None:
        """Serve a client no longer; may be called twice."""
        self._sockets.discard(socket)
        self.hub.remove(socket.client)

    def _update(self) -> None:
        is_done = self._source.want(self.hub.wanted_topics)
        if is_done:
            self.hub.forget_latched()
        if self._sockets:
            self.hub.update_topics(self._source.find_types())
        elif is_done:
            self._tick.stop()
        self.hub.deliver(self._source.take())
        for socket in self._sockets:
            socket.send_waiting()

    def close(self) -> None:
        """Disconnect all clients."""
        self._tick.stop()
        for socket in list(self._sockets):
            socket.close(1001, "the monitor ends")
