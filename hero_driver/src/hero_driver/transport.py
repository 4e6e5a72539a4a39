"""TCP: accepts robots that dial in, dials robots that are servers; owns sockets, clock and write buffers.

One thread runs the loop and calls a LinkHandler with bytes; it knows nothing of frames beyond that each one
is written with one send. Other threads hand over work with EventLoop.call_soon(). Nothing here blocks.
"""

import collections
import errno
import fcntl
import heapq
import itertools
import os
import selectors
import socket
import struct
import termios
import threading
import time
from typing import Any, Callable, Deque, Dict, List, NamedTuple, Optional, Tuple

READ_LENGTH = 65536
"""One read takes all that a robot can have sent: 1 s of stock data has 44 kB."""

LISTEN_BACKLOG = 256
"""A whole swarm reconnects within 51 ms when the driver comes back (ArduinoTcpHardware.h:99)."""

POLL_INTERVAL_S = 0.1
"""Sessions are polled this often for what is due (repeated requests, silence)."""

DIAL_BACKOFF_FIRST_S = 0.5
DIAL_BACKOFF_MAX_S = 10.0
DIAL_TIMEOUT_S = 5.0

ACCEPT_PAUSE_S = 0.5
"""Rest of the listener when the process has no file descriptors left; those connected go on."""

_INT = struct.Struct("i")


class Address(NamedTuple):
    """The far or near end of a connection."""

    host: str
    port: int

    def __str__(self) -> str:
        return "[%s]:%d" % self if ":" in self.host else "%s:%d" % self


class LinkHandler:
    """What the transport calls, always on the loop's thread."""

    def open_link(self, link: "Link") -> Optional[str]:
        """A connection stands; return a reason to refuse it, or None."""
        raise NotImplementedError

    def receive_data(self, link: "Link", data: bytes, now_s: float) -> None:
        """Bytes came in."""
        raise NotImplementedError

    def close_link(self, link: "Link", reason: str) -> None:
        """The connection is gone, by whichever side."""
        raise NotImplementedError

    def poll_link(self, link: "Link", now_s: float) -> None:
        """Called every POLL_INTERVAL_S for each connection."""
        raise NotImplementedError

    def report_trouble(self, text: str) -> None:
        """Something about the network itself should reach the user's eyes."""
        raise NotImplementedError


class Link:
    """One TCP connection to one robot."""

    def __init__(self, loop: "EventLoop", sock: socket.socket, address: Address, dialled: bool) -> None:
        self.address = address
        self.dialled = dialled
        self.closed = False
        self.peer: Any = None  # the handler's own record of who is at the other end
        self.written_length = 0  # bytes that the system has taken so far
        self.received_length = 0
        self._loop = loop
        self._socket = sock
        self._unsent: Deque[bytes] = collections.deque()

    def send_frame(self, frame: bytes) -> None:
        """Write one whole frame with one send, or keep it until the socket takes it."""
        if self.closed:
            return
        if self._unsent:
            self._unsent.append(frame)
            return
        rest = self._write(frame)
        if rest:
            self._unsent.append(rest)
            self._loop.watch(self, writable=True)

    @property
    def unsent_frames(self) -> int:
        """Frames that the socket has not taken yet, one of them perhaps in part."""
        return len(self._unsent)

    def read_unacknowledged_length(self) -> int:
        """Return how many bytes the peer's TCP has not acknowledged, 0 where the system cannot tell."""
        if self.closed:
            return 0
        try:
            # SIOCOUTQ has the number of TIOCOUTQ (tcp(7)).
            answer = fcntl.ioctl(self._socket.fileno(), termios.TIOCOUTQ, b"\0\0\0\0")
        except OSError:
            return 0
        length: int = _INT.unpack(answer)[0]
        return length

    def close(self, reason: str) -> None:
        """Close the connection; safe to call twice."""
        self._loop.close_link(self, reason)

    def fileno(self) -> int:
        """Return the socket's file descriptor."""
        return self._socket.fileno()

    def read(self) -> Optional[bytes]:
        """Return bytes, b"" at the end of the stream, None if there is nothing to read now.

        Raises: OSError when the connection broke.
        """
        try:
            return self._socket.recv(READ_LENGTH)
        except (BlockingIOError, InterruptedError):
            return None

    def flush(self) -> bool:
        """Write what is left over; return whether nothing is left.

        Raises: OSError when the connection broke.
        """
        while self._unsent:
            rest = self._write(self._unsent[0])
            if rest:
                self._unsent[0] = rest
                return False
            self._unsent.popleft()
        return True

    def discard(self) -> None:
        """Close the socket itself; only the loop calls this."""
        self.closed = True
        self._unsent.clear()
        self._socket.close()

    def _write(self, data: bytes) -> bytes:
        """Return what the socket did not take."""
        try:
            sent = self._socket.send(data)
        except (BlockingIOError, InterruptedError):
            return data
        except OSError as error:
            self._loop.call_soon(lambda: self.close("write failed: %s" % _describe(error)))
            return b""
        self.written_length += sent
        return data[sent:]


class TransportSettings(NamedTuple):
    """Where and how to connect."""

    host: str  # empty: do not listen
    port: int  # 0: any free one
    dial: Tuple[Address, ...]
    user_timeout_s: float
    """After this time without acknowledgement the kernel gives a connection up (TCP_USER_TIMEOUT)."""


class EventLoop:
    """The thread that owns all sockets. open(), then run() on that thread, stop() from any."""

    def __init__(self, settings: TransportSettings, handler: LinkHandler) -> None:
        self._settings = settings
        self._handler = handler
        self._selector = selectors.DefaultSelector()
        self._listener: Optional[socket.socket] = None
        self._links: Dict[int, Link] = {}
        self._timers: List[Tuple[float, int, Callable[[], None]]] = []
        self._timer_numbers = itertools.count()
        self._calls: Deque[Callable[[], None]] = collections.deque()
        self._wake_lock = threading.Lock()
        self._is_awake = False
        self._wake_read, self._wake_write = os.pipe()
        os.set_blocking(self._wake_read, False)
        os.set_blocking(self._wake_write, False)
        self._running = True
        self._dial_resolver = _Resolver()
        self.listening: Optional[Address] = None

    def open(self) -> None:
        """Bind the listening socket and begin to dial.

        Raises: OSError if the address cannot be bound.
        """
        self._selector.register(self._wake_read, selectors.EVENT_READ, None)
        if self._settings.host:
            self._listener = _listen(self._settings.host, self._settings.port)
            self.listening = Address(*self._listener.getsockname()[:2])
            self._selector.register(self._listener, selectors.EVENT_READ, None)
        for address in self._settings.dial:
            _Dialler(self, address).dial()
        self.call_later(POLL_INTERVAL_S, self._poll_links)

    def run(self) -> None:
        """Serve until stop(); then close everything."""
        select = self._selector.select
        while self._running:
            timeout_s = max(0.0, self._timers[0][0] - time.monotonic()) if self._timers else None
            for key, mask in select(timeout_s):
                link = key.data
                if link is None:
                    self._serve_own(key.fd)
                elif isinstance(link, _Dialler):
                    link.finish()
                else:
                    if mask & selectors.EVENT_WRITE:
                        self._serve_write(link)
                    if mask & selectors.EVENT_READ and not link.closed:
                        self._serve_read(link)
            self._run_due()
        self._close_all()

    def stop(self) -> None:
        """Let run() return; from any thread."""
        self.call_soon(self._end)

    def call_soon(self, call: Callable[[], None]) -> None:
        """Run call on the loop's thread, soon; from any thread."""
        self._calls.append(call)
        with self._wake_lock:
            if self._is_awake:
                return
            self._is_awake = True
        os.write(self._wake_write, b"\0")

    def call_later(self, delay_s: float, call: Callable[[], None]) -> None:
        """Run call after delay_s; only from the loop's thread."""
        heapq.heappush(self._timers, (time.monotonic() + delay_s, next(self._timer_numbers), call))

    def watch(self, link: Link, writable: bool) -> None:
        """Choose whether the loop waits until link can be written."""
        mask = selectors.EVENT_READ | (selectors.EVENT_WRITE if writable else 0)
        self._selector.modify(link, mask, link)

    def close_link(self, link: Link, reason: str) -> None:
        """Close link and tell the handler; safe to call twice."""
        if link.closed:
            return
        del self._links[link.fileno()]
        self._selector.unregister(link)
        link.discard()
        self._handler.close_link(link, reason)

    def add_link(self, sock: socket.socket, address: Address, dialled: bool) -> Optional[Link]:
        """Take over a connected socket; return its link, or None if it was refused or broke already."""
        link = Link(self, sock, address, dialled)
        try:
            self._set_options(sock)
        except OSError as error:
            # The peer may be gone already.
            link.discard()
            self._handler.report_trouble("connection of %s broke at once: %s" % (address, _describe(error)))
            return None
        self._links[sock.fileno()] = link
        self._selector.register(link, selectors.EVENT_READ, link)
        refusal = self._handler.open_link(link)
        if refusal is not None:
            link.close(refusal)
            return None
        return link

    def _set_options(self, sock: socket.socket) -> None:
        sock.setblocking(False)
        # The robot drops a frame whose parts arrive more than 20 ms apart (node_handle.h:199), so nothing
        # may wait for an acknowledgement.
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        user_timeout_ms = int(self._settings.user_timeout_s * 1000)
        for option, value in (
            ("TCP_KEEPIDLE", max(1, user_timeout_ms // 2000)),
            ("TCP_KEEPINTVL", 1),
            ("TCP_KEEPCNT", 3),
            ("TCP_USER_TIMEOUT", user_timeout_ms),
        ):
            if hasattr(socket, option):
                sock.setsockopt(socket.IPPROTO_TCP, getattr(socket, option), value)

    def _serve_own(self, fd: int) -> None:
        if fd == self._wake_read:
            with self._wake_lock:
                os.read(self._wake_read, 1)
                self._is_awake = False
            for _ in range(len(self._calls)):
                self._calls.popleft()()
        else:
            self._accept()

    def _accept(self) -> None:
        listener = self._listener
        if listener is None:
            return
        for _ in range(LISTEN_BACKLOG):
            try:
                sock, address = listener.accept()
            except (BlockingIOError, InterruptedError, ConnectionAbortedError):
                return
            except OSError as error:
                self._pause_accept(listener, error)
                return
            self.add_link(sock, Address(*address[:2]), dialled=False)

    def _pause_accept(self, listener: socket.socket, error: OSError) -> None:
        remedy = ""
        if error.errno in (errno.EMFILE, errno.ENFILE):
            remedy = "; raise the limit of open files (ulimit -n) and start again"
        self._handler.report_trouble(
            "cannot take more connections (%s)%s; those connected go on" % (_describe(error), remedy)
        )
        self._selector.unregister(listener)

        def resume() -> None:
            if self._listener is not None:
                self._selector.register(listener, selectors.EVENT_READ, None)

        self.call_later(ACCEPT_PAUSE_S, resume)

    def _serve_read(self, link: Link) -> None:
        try:
            data = link.read()
        except OSError as error:
            self.close_link(link, "read failed: %s" % _describe(error))
            return
        if data is None:
            return
        if not data:
            self.close_link(link, "closed by the robot")
            return
        link.received_length += len(data)
        self._handler.receive_data(link, data, time.monotonic())

    def _serve_write(self, link: Link) -> None:
        if link.flush() and not link.closed:
            self.watch(link, writable=False)

    def _run_due(self) -> None:
        now_s = time.monotonic()
        while self._timers and self._timers[0][0] <= now_s:
            heapq.heappop(self._timers)[2]()

    def _poll_links(self) -> None:
        now_s = time.monotonic()
        for link in list(self._links.values()):
            if not link.closed:
                self._handler.poll_link(link, now_s)
        self.call_later(POLL_INTERVAL_S, self._poll_links)

    def _end(self) -> None:
        self._running = False

    def _close_all(self) -> None:
        if self._listener is not None:
            self._listener.close()
            self._listener = None
        for link in list(self._links.values()):
            self.close_link(link, "the driver ends")
        self._selector.close()
        self._dial_resolver.close()

    # What the diallers use.

    def resolve(self, address: Address, then: Callable[[Optional[Any], str], None]) -> None:
        """Look address up on a thread of its own, then call then(sockaddr info or None, error) on the loop."""
        self._dial_resolver.resolve(
            address, lambda info, error: self.call_soon(lambda: then(info, error))
        )

    def watch_dialler(self, dialler: "_Dialler", sock: socket.socket) -> None:
        """Call dialler.finish() when sock has connected or failed."""
        self._selector.register(sock, selectors.EVENT_WRITE, dialler)

    def unwatch_dialler(self, sock: socket.socket) -> None:
        """Undo watch_dialler()."""
        self._selector.unregister(sock)

    def report_trouble(self, text: str) -> None:
        """Pass text on to the handler."""
        self._handler.report_trouble(text)


class _Dialler:
    """Dials one robot that is a server, again and again with back-off while it is away."""

    def __init__(self, loop: EventLoop, address: Address) -> None:
        self._loop = loop
        self._address = address
        self._backoff_s = DIAL_BACKOFF_FIRST_S
        self._socket: Optional[socket.socket] = None
        self._link: Optional[Link] = None
        self._attempt = 0
        self._reported = ""

    def dial(self) -> None:
        self._loop.resolve(self._address, self._connect)

    def finish(self) -> None:
        """The socket has connected or failed."""
        sock = self._socket
        if sock is None:
            return
        self._loop.unwatch_dialler(sock)
        self._socket = None
        error_number = sock.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if error_number:
            sock.close()
            self._retry(os.strerror(error_number))
            return
        self._link = self._loop.add_link(sock, self._address, dialled=True)
        self._backoff_s = DIAL_BACKOFF_FIRST_S
        self._reported = ""
        self._watch_link()

    def _connect(self, info: Optional[Any], error: str) -> None:
        if info is None:
            self._retry(error)
            return
        family, kind, protocol, _, target = info
        sock = socket.socket(family, kind, protocol)
        sock.setblocking(False)
        self._socket = sock
        result = sock.connect_ex(target)
        if result not in (0, errno.EINPROGRESS):
            self._socket = None
            sock.close()
            self._retry(os.strerror(result))
            return
        self._loop.watch_dialler(self, sock)
        self._attempt += 1
        attempt = self._attempt
        self._loop.call_later(DIAL_TIMEOUT_S, lambda: self._give_up(attempt))

    def _give_up(self, attempt: int) -> None:
        if self._socket is not None and attempt == self._attempt:
            self._loop.unwatch_dialler(self._socket)
            self._socket.close()
            self._socket = None
            self._retry("no answer within %.0f s" % DIAL_TIMEOUT_S)

    def _retry(self, error: str) -> None:
        if error != self._reported:
            self._reported = error
            self._loop.report_trouble(
                "robot at %s cannot be reached: %s; dialling again, check that it is on and that host and port"
                " in ~robots are right" % (self._address, error)
            )
        self._loop.call_later(self._backoff_s, self.dial)
        self._backoff_s = min(2 * self._backoff_s, DIAL_BACKOFF_MAX_S)

    def _watch_link(self) -> None:
        if self._link is None or self._link.closed:
            self._loop.call_later(self._backoff_s, self.dial)
            self._backoff_s = min(2 * self._backoff_s, DIAL_BACKOFF_MAX_S)
        else:
            self._loop.call_later(POLL_INTERVAL_S, self._watch_link)


class _Resolver:
    """Name look-ups on a thread of their own, because they can block for seconds."""

    def __init__(self) -> None:
        self._jobs: Deque[Optional[Tuple[Address, Callable[[Optional[Any], str], None]]]] = collections.deque()
        self._ready = threading.Semaphore(0)
        self._thread: Optional[threading.Thread] = None

    def resolve(self, address: Address, then: Callable[[Optional[Any], str], None]) -> None:
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="resolver", daemon=True)
            self._thread.start()
        self._jobs.append((address, then))
        self._ready.release()

    def close(self) -> None:
        """End the thread after the look-up that it is in."""
        self._jobs.append(None)
        self._ready.release()

    def _run(self) -> None:
        while True:
            self._ready.acquire()
            job = self._jobs.popleft()
            if job is None:
                return
            address, then = job
            try:
                infos = socket.getaddrinfo(address.host, address.port, type=socket.SOCK_STREAM)
            except OSError as error:
                then(None, _describe(error))
            else:
                then(infos[0], "")


def _listen(host: str, port: int) -> socket.socket:
    infos = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    family, kind, protocol, _, target = infos[0]
    sock = socket.socket(family, kind, protocol)
    try:
        # A driver that starts again must not wait for the old one's connections to time out.
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        sock.bind(target)
        sock.listen(LISTEN_BACKLOG)
        sock.setblocking(False)
    except OSError:
        sock.close()
        raise
    return sock


def _describe(error: OSError) -> str:
    return error.strerror or str(error)
