"""The WebSocket /foxglove: one connection per client, with the access rules of the page; clients only read.

Source: https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md, version 1.
"""

import contextlib
import json
import struct
import time
from collections import defaultdict, deque
from typing import Any, Awaitable, DefaultDict, Deque, Dict, FrozenSet, List, Optional, Sequence, Set, Tuple, Union

import tornado.ioloop
import tornado.iostream
import tornado.web
import tornado.websocket

from hero_node import shorten
from hero_node.parameters import is_whole_number

from ..serving.lesson import User
from ..serving.server import BaseHandler, Route, send_text
from .topics import Channel, RosTopics

SUBPROTOCOLS = ("foxglove.sdk.v1", "foxglove.websocket.v1")
"""Both carry the same messages."""

WARNING = 1
"""Level of a status."""

CLIENTS_MAX = 10
SUBSCRIPTIONS_MAX = 10_000
UPDATE_PERIOD_S = 0.02
MAX_REQUEST_LENGTH = 1_000_000
"""A subscription to each of ten thousand topics."""

QUEUE_BYTES_MAX = 4_000_000
"""Queue limit of one client: about a second of a large swarm with a camera's images."""

MESSAGE_DATA = 0x01
_HEADER = struct.Struct("<BIQ")  # opcode, id of the subscription, time of arrival in ns
_BINARY = 0x82  # first byte of a WebSocket frame that is a whole binary message
_SHORT_FRAME, _FRAME, _LONG_FRAME = struct.Struct("!BB"), struct.Struct("!BBH"), struct.Struct("!BBQ")


def encode_message(subscription: int, time_ns: int, content: bytes) -> bytes:
    """Return the WebSocket frame that carries a message, as servers send it: whole and not masked (RFC 6455, 5.2)."""
    length = _HEADER.size + len(content)
    if length < 126:
        head = _SHORT_FRAME.pack(_BINARY, length)
    elif length < 65536:
        head = _FRAME.pack(_BINARY, 126, length)
    else:
        head = _LONG_FRAME.pack(_BINARY, 127, length)
    return head + _HEADER.pack(MESSAGE_DATA, subscription, time_ns) + content


class FoxgloveSocket(tornado.websocket.WebSocketHandler, BaseHandler):
    """The socket of one client: what it was offered, its subscriptions, and what waits to be sent."""

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
        if len(self.endpoint.sockets) >= CLIENTS_MAX:
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
        self.subscriptions: Dict[int, Channel] = {}
        self._offered: Dict[int, Channel] = {}
        self._frames: Deque[bytes] = deque()
        self._frames_bytes = 0
        self._sending: Any = None
        self._refusal = ""  # of the last request; said once in a row
        self._has_dropped = False
        self.set_nodelay(True)
        self._tell("serverInfo", name="hero_monitor", metadata={}, supportedEncodings=["ros1"], capabilities=[])
        self.endpoint.add(self)

    def on_close(self) -> None:
        """Forget a client."""
        self.subscriptions = {}
        self.endpoint.sockets.discard(self)

    def _tell(self, operation: str, **fields: Any) -> None:
        """Send a text of the protocol."""
        send_text(self, json.dumps({"op": operation, **fields}))

    def _warn(self, text: str) -> None:
        """Send a line for the users of the client."""
        self._tell("status", level=WARNING, message=text)

    # ---------------------------------------------------------------- requests

    def on_message(self, message: Union[str, bytes]) -> None:
        """Carry out a client's request, or tell it why not."""
        try:
            refusal = self._carry_out({"op": "publish"} if isinstance(message, bytes) else json.loads(message))
        except (ValueError, TypeError, KeyError, RecursionError) as error:
            refusal = f"invalid request: {type(error).__name__}"
        if refusal and refusal != self._refusal:
            self._warn(refusal)
        self._refusal = refusal

    def _carry_out(self, request: Any) -> str:
        """Carry out a request as the protocol names its fields; return why not, empty if it is done.

        Raises: ValueError, TypeError or KeyError for other fields.
        """
        op = request["op"]
        if op == "subscribe":
            pairs = [(each["id"], self._offered.get(each["channelId"])) for each in request["subscriptions"]]
            refused = [number for number, channel in pairs if not self._subscribe(number, channel)]
            return f"subscriptions refused: {shorten(refused)}" if refused else ""
        if op == "unsubscribe":
            for number in request["subscriptionIds"]:
                self.subscriptions.pop(number, None)
            return ""
        return f"{shorten(op)}: clients of this server only read"

    def _subscribe(self, number: Any, channel: Optional[Channel]) -> bool:
        is_free = is_whole_number(number, 0, 2**32 - 1) and number not in self.subscriptions
        if channel is None or not is_free or len(self.subscriptions) >= SUBSCRIPTIONS_MAX:
            return False
        self.subscriptions[number] = channel
        for content in self.endpoint.topics.find_latched(channel):
            self.put(number, content)
        return True

    # ---------------------------------------------------------------- topics and messages

    def offer(self, channels: Dict[int, Channel]) -> None:
        """Offer the channels that are new, and withdraw those that have gone, with their subscriptions."""
        if channels is self._offered:
            return
        gone, new = sorted(set(self._offered) - set(channels)), sorted(set(channels) - set(self._offered))
        self._offered = channels
        self.subscriptions = {number: kept for number, kept in self.subscriptions.items() if kept.id in channels}
        if gone:
            self._tell("unadvertise", channelIds=gone)
        if new:
            self._tell("advertise", channels=[channels[number].describe() for number in new])

    def put(self, number: int, content: bytes) -> None:
        """Queue a message for a subscription; beyond QUEUE_BYTES_MAX the oldest is dropped."""
        frame = encode_message(number, time.time_ns(), content)
        self._frames.append(frame)
        self._frames_bytes += len(frame)
        while self._frames_bytes > QUEUE_BYTES_MAX and len(self._frames) > 1:
            self._frames_bytes -= len(self._frames.popleft())
            if not self._has_dropped:
                self._has_dropped = True
                self._warn("this client is slower than its topics: old messages are dropped")

    def send_waiting(self) -> None:
        """Send what waits, unless the client is still receiving the last of it."""
        stream = getattr(self.ws_connection, "stream", None)
        if stream is None or not self._frames or not (self._sending is None or self._sending.done()):
            return
        # One write for all: tornado's write_message() takes longer for each frame than all else that it passes.
        with contextlib.suppress(tornado.iostream.StreamClosedError):
            self._sending = stream.write(b"".join(self._frames))
        self._frames.clear()
        self._frames_bytes = 0


class FoxgloveEndpoint:
    """All clients; topics are looked up and subscribed to only while there is one."""

    def __init__(self, topics: RosTopics, origins: Sequence[str]) -> None:
        """origins: of other servers whose pages may connect."""
        self.topics = topics
        self.sockets: Set[FoxgloveSocket] = set()
        self._tick = tornado.ioloop.PeriodicCallback(self._update, 1000.0 * UPDATE_PERIOD_S)
        values = {"endpoint": self, "origins": frozenset(origin.lower() for origin in origins)}
        self.route: Route = (r"/foxglove/?", FoxgloveSocket, values)

    def add(self, socket: FoxgloveSocket) -> None:
        """Serve a client until it closes."""
        self.sockets.add(socket)
        if not self._tick.is_running():
            self._tick.start()

    def _update(self) -> None:
        subscribers: DefaultDict[Channel, List[Tuple[FoxgloveSocket, int]]] = defaultdict(list)
        self.topics.look_up()
        for socket in self.sockets:
            socket.offer(self.topics.channels)
            for number, channel in socket.subscriptions.items():
                subscribers[channel].append((socket, number))
        for channel, content in self.topics.take():
            for socket, number in subscribers.get(channel, ()):
                socket.put(number, content)
        for socket in self.sockets:
            socket.send_waiting()
        if self.topics.want(set(subscribers)) and not self.sockets:
            self._tick.stop()

    def close(self) -> None:
        """Disconnect all clients."""
        self._tick.stop()
        for socket in list(self.sockets):
            socket.close(1001, "the monitor ends")
