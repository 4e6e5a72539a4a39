"""The loop that owns all sockets, timers and the clock, and the listening socket with them."""

import contextlib
import errno
import functools
import heapq
import itertools
import math
import os
import queue
import select
import socket
import threading
import time
from typing import Callable, Dict, List, Optional, Protocol, Set, Tuple, TypeVar

from hero_node import raise_file_limit

from .call_queue import CallQueue
from .link import Address, Link, LinkHandler, LinkOwner, describe_error

T = TypeVar("T")

CallLater = Callable[[float, Callable[[], None]], None]
"""EventLoop.call_later() as its users get it."""

READ = select.EPOLLIN
WRITE = select.EPOLLOUT

LISTEN_BACKLOG = 256
"""A whole swarm reconnects within 51 ms when the driver is restarted (ArduinoTcpHardware.h:99)."""

POLL_INTERVAL_S = 0.05
"""Period of poll(), and of poll_link() for every other connection: one timer for all, as each costs a turn."""

PAUSE_S = 1.0
"""Time from one turn of the loop to the next, s, beyond which the driver or its PC was suspended, or too busy."""

LATE_TURN_S = 0.1
"""Time from one turn of the loop to the next, s, beyond which it lacks CPU: it has a timer every POLL_INTERVAL_S."""

LATE_KEPT_S = 5.0
"""For so long it is known that the loop was late."""

CALLS_MAX = 10000
"""Calls of other threads that may wait: each of them has a bound of its own, so more come only if the loop hangs."""

ACCEPT_PAUSE_S = 0.5
"""Rest of the listener when the process has no file descriptors left; connected robots are not affected."""

FILES_RESERVED = 64
"""Files that robots leave to ROS, at most a quarter: rospy takes no subscriber ever again once it had none left."""

THE_DRIVER_ENDS = "the driver ends"
"""Reason with which all links are closed at the end."""


class NoAnswerError(Exception):
    """The loop did not answer in time: it hangs or has ended."""


class HostNotFoundError(OSError):
    """A host is neither an address nor a name that leads to one; the text says so of it."""


class Reader(Protocol):
    """Another socket that the loop reads besides the robots' connections."""

    def fileno(self) -> int:
        """Return the socket's file descriptor, the same one until close()."""

    def read(self) -> bool:
        """Read what there is, without waiting; return whether to continue. On the loop's thread."""

    def resume(self) -> None:
        """Be told that data may have come in a pause in which the loop did not run."""

    def close(self) -> None:
        """Release the socket: read() returned False or raised, or the loop ends."""


class EventLoop(LinkOwner):
    """The thread that owns all sockets. open(), then run() on that thread, stop() from any."""

    def __init__(self, host: str, port: int, user_timeout_s: float) -> None:
        """Listen on host and port (0: any); the kernel waits user_timeout_s for acknowledgements (TCP_USER_TIMEOUT)."""
        self._host, self._port = host, port
        self._user_timeout_ms = int(user_timeout_s * 1000)
        self._handler = LinkHandler()
        # selectors does the same, but what it adds in Python is a twentieth of all that the driver does.
        self._epoll = select.epoll()
        self._serves: Dict[int, Callable[[int], object]] = {}
        self._listener: Optional[socket.socket] = None
        self._links: Dict[int, Link] = {}
        self._readers: Set[Reader] = set()
        self._thread_id = 0
        self._turned_s = 0.0  # when the last turn ended
        self._ran_s = math.inf  # when the loop was last seen to run, on a clock that runs while the PC sleeps
        self._resumed_s = -math.inf
        self._late_s, self._late_seen_s = 0.0, -math.inf
        self._polls = 0
        self._timers: List[Tuple[float, int, Callable[[], None]]] = []
        self._timer_numbers = itertools.count()
        self._calls = CallQueue(CALLS_MAX, self._wake, self._report_call)
        self._wake_receiver, self._wake_sender = socket.socketpair()
        self._wake_receiver.setblocking(False)
        self._wake_sender.setblocking(False)
        self._is_running = True
        self._file_limit = raise_file_limit()
        self.listening = Address(host, port)

    def open(self, handler: LinkHandler) -> None:
        """Listen; handler receives the events of all links. Raises: OSError if the address cannot be bound."""
        self._handler = handler
        self._listener = _listen(self._host, self._port)
        self.listening = Address(*self._listener.getsockname()[:2])
        self._listen_on(self._listener)
        self._register(self._wake_receiver.fileno(), READ, lambda _: self._wake_receiver.recv(4096))
        self.call_later(POLL_INTERVAL_S, self._poll)

    def run(self) -> None:
        """Serve until stop(), or until something breaks; then stop the robots, and close everything."""
        self._thread_id = threading.get_ident()
        self._turned_s = time.monotonic()
        try:
            while self._is_running:
                self._run_once()
        finally:
            try:
                self._handler.stop_at_end()
            finally:
                self._close_all()

    def _run_once(self) -> None:
        timeout_s = None
        waiting = self._calls.waiting
        if waiting:
            timeout_s = 0.0
        elif self._timers:
            timeout_s = self._timers[0][0] - self._turned_s
            if timeout_s < 0.0:
                timeout_s = 0.0
        serves = self._serves
        ready = self._epoll.poll(timeout_s)
        self._look_for_pause()
        for descriptor, mask in ready:
            # What was closed in this turn is not there. Where its number has gone to, there is a connection that was
            # accepted since, and reading it for nothing does no harm.
            serve = serves.get(descriptor)
            if serve is not None:
                serve(mask)
        if waiting:
            self._calls.make_calls()
        now_s = self._turned_s = time.monotonic()
        while self._timers and self._timers[0][0] <= now_s:
            self._call(heapq.heappop(self._timers)[2])

    def _look_for_pause(self) -> None:
        """Tell the others of a pause in which this loop did not run, before anything is read that came meanwhile."""
        ran_s, self._ran_s = self._ran_s, time.clock_gettime(time.CLOCK_BOOTTIME)
        pause_s = self._ran_s - ran_s
        if pause_s > LATE_TURN_S:
            self._late_s = max(pause_s, self.find_lateness_s())
            self._late_seen_s = time.monotonic()
        if pause_s > PAUSE_S:
            self._resumed_s = time.monotonic()
            for reader in self._readers:
                reader.resume()
            self._handler.resume(self._resumed_s)

    def has_resumed_within(self, duration_s: float) -> bool:
        """Return whether a pause has just ended in which this loop did not run; from any thread."""
        return time.monotonic() - self._resumed_s < duration_s

    def find_lateness_s(self) -> float:
        """Return the longest recent time for which this loop did not run though it was due to; 0 if there was none."""
        return self._late_s if time.monotonic() - self._late_seen_s < LATE_KEPT_S else 0.0

    def stop(self) -> None:
        """Make run() return; from any thread."""
        self._calls.submit(self._end, always=True)

    def call_soon(self, call: Callable[[], None]) -> None:
        """Run call on the loop's thread, soon; from any thread. Dropped if CALLS_MAX others wait already."""
        self._calls.submit(call, always=threading.get_ident() == self._thread_id)

    def ask(self, call: Callable[[Callable[[T], None]], None], timeout_s: float) -> T:
        """Run call(answer) on the loop's thread; return its answer. Raises: NoAnswerError after timeout_s."""
        answers: queue.SimpleQueue[T] = queue.SimpleQueue()
        self.call_soon(lambda: call(answers.put))
        try:
            return answers.get(timeout=timeout_s)
        except queue.Empty:
            raise NoAnswerError(f"the driver did not answer within {timeout_s:.1f} s") from None

    def _wake(self) -> None:
        # The loop looks at its calls before it waits again.
        if threading.get_ident() != self._thread_id:
            # Where the socket is full the loop has been woken already; where it is closed the loop has ended.
            with contextlib.suppress(OSError):
                self._wake_sender.send(b"\0")

    def _report_call(self, error: BaseException) -> None:
        if not isinstance(error, Exception):
            raise error
        self._handler.report_bug(error)

    def add_reader(self, reader: Reader) -> None:
        """Read reader whenever there is something to read, until it ends; from any thread."""
        self.call_soon(lambda: self._watch_reader(reader))

    def call_later(self, delay_s: float, call: Callable[[], None]) -> None:
        """Run call after delay_s; only from the loop's thread."""
        heapq.heappush(self._timers, (time.monotonic() + delay_s, next(self._timer_numbers), call))

    def watch(self, link: Link) -> None:
        """Wait until link can be read, and until it can be written where something is unsent."""
        self._epoll.modify(link.fileno(), READ | (WRITE if link.is_full else 0))

    def close_link(self, link: Link, reason: str) -> None:
        if link.closed:
            return
        del self._links[link.fileno()]
        self._unregister(link.fileno())
        link.discard()
        self._handler.close_link(link, reason)

    def _add_link(self, sock: socket.socket, address: Address) -> None:
        """Take over a connected socket, which may be closed again at once."""
        link = Link(self, sock, address)
        try:
            self._set_options(sock)
        except OSError as error:
            # The peer may be gone already.
            link.discard()
            self._handler.warn_network(f"connection of {address} broke at once: {describe_error(error)}")
            return
        self._links[sock.fileno()] = link
        self._register(sock.fileno(), READ, functools.partial(self._serve_link, link))
        try:
            refusal = self._handler.open_link(link)
        except Exception as error:  # noqa: BLE001 - our mistake with this one must not keep others out
            self._handler.report_bug(error)
            refusal = "a bug of the driver"
        if refusal is not None:
            link.close(refusal)

    def _set_options(self, sock: socket.socket) -> None:
        sock.setblocking(False)
        # The robot drops a packet whose parts arrive more than 20 ms apart (node_handle.h:199), so nothing
        # may wait for an acknowledgement.
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, max(1, self._user_timeout_ms // 2000))
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, 1)
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPCNT, 3)
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, self._user_timeout_ms)

    def _register(self, descriptor: int, mask: int, serve: Callable[[int], object]) -> None:
        """Call serve(what descriptor is ready for, neither READ nor WRITE where it broke) when mask says so."""
        self._epoll.register(descriptor, mask)
        self._serves[descriptor] = serve

    def _unregister(self, descriptor: int) -> None:
        """Undo _register(), before descriptor is closed."""
        self._epoll.unregister(descriptor)
        del self._serves[descriptor]

    def _serve_link(self, link: Link, mask: int) -> None:
        try:
            if mask & WRITE:
                link.flush()
                if not link.is_full and not link.closed:
                    self.watch(link)
            # What is neither is a broken connection, of which reading says why.
            if mask != WRITE and not link.closed:
                data = link.read()
                if data:
                    self._handler.receive_data(link, data, time.monotonic())
        except Exception as error:  # noqa: BLE001 - an error with one robot is not the others'
            self._handler.report_bug(error)
            self.close_link(link, "a bug of the driver")

    def _call(self, call: Callable[[], None]) -> None:
        try:
            call()
        except Exception as error:  # noqa: BLE001 - as above; the loop is all that can still stop the robots
            self._handler.report_bug(error)

    def _watch_reader(self, reader: Reader) -> None:
        self._readers.add(reader)
        self._register(reader.fileno(), READ, functools.partial(self._serve_reader, reader))

    def _serve_reader(self, reader: Reader, _mask: int) -> None:
        goes_on = False
        try:
            self._look_for_pause()
            goes_on = reader.read()
        except Exception as error:  # noqa: BLE001 - as above
            self._handler.report_bug(error)
        if not goes_on:
            self._unregister(reader.fileno())
            self._readers.discard(reader)
            reader.close()

    def _listen_on(self, listener: socket.socket) -> None:
        self._register(listener.fileno(), READ, lambda _: self._call(self._accept))

    def _accept(self) -> None:
        listener = self._listener
        if listener is None:
            return
        # One in a turn of the loop: of a program that connects as fast as it can, many would wait each time.
        try:
            sock, address = listener.accept()
        except (BlockingIOError, InterruptedError, ConnectionAbortedError):
            return
        except OSError as error:
            self._pause_accept(listener, error)
            return
        # The system gives out the lowest free number, so this is about how many are in use.
        if sock.fileno() >= self._file_limit - min(FILES_RESERVED, self._file_limit // 4):
            sock.close()
            self._pause_accept(listener, OSError(errno.EMFILE, os.strerror(errno.EMFILE)))
            return
        self._add_link(sock, Address(*address[:2]))

    def _pause_accept(self, listener: socket.socket, error: OSError) -> None:
        remedy = ""
        if error.errno in (errno.EMFILE, errno.ENFILE):
            remedy = "; raise the limit of open files (ulimit -n) and start again"
        text = f"cannot take more connections ({describe_error(error)}){remedy}; connected robots are not affected"
        self._handler.warn_network(text)
        self._unregister(listener.fileno())

        def resume() -> None:
            if self._listener is not None:
                self._listen_on(listener)

        self.call_later(ACCEPT_PAUSE_S, resume)

    def _poll(self) -> None:
        self.call_later(POLL_INTERVAL_S, self._poll)
        now_s = time.monotonic()
        self._call(lambda: self._handler.poll(now_s))
        self._polls += 1
        for link in list(self._links.values())[self._polls % 2 :: 2]:
            if not link.closed:
                self._call(functools.partial(self._handler.poll_link, link, now_s))

    def _end(self) -> None:
        self._is_running = False

    def _close_all(self) -> None:
        if self._listener is not None:
            self._listener.close()
            self._listener = None
        for link in list(self._links.values()):
            self.close_link(link, THE_DRIVER_ENDS)
        for reader in self._readers:
            reader.close()
        self._epoll.close()
        self._wake_receiver.close()
        self._wake_sender.close()


def _listen(host: str, port: int) -> socket.socket:
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    except (OSError, ValueError) as error:
        # What is no name at all ("10.42.0..1") is a UnicodeError of the codec for names.
        reason = describe_error(error) if isinstance(error, OSError) else "not a host's name"
        raise HostNotFoundError(f"{host!a} cannot be found ({reason})") from error
    family, _, _, _, target = found[0]
    # SO_REUSEADDR is set: a driver that starts again need not wait for the old one's connections to time out.
    dualstack = family == socket.AF_INET6 and socket.has_dualstack_ipv6()
    listener = socket.create_server(target, family=family, backlog=LISTEN_BACKLOG, dualstack_ipv6=dualstack)
    listener.setblocking(False)
    return listener
