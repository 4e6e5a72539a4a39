"""Dials robots that are TCP servers, again and again while they are away; names are looked up on threads."""

import errno
import os
import socket
import threading
import time
from typing import Any, Callable, Optional

from .link import Address, HostNotFoundError, Link, describe_error, find_socket_address

BACKOFF_FIRST_S = 0.5
BACKOFF_MAX_S = 10.0
CONNECT_TIMEOUT_S = 5.0

STOOD_S = 3.0
"""A link that stood for so long is worth a quick return; one that hangs up at once is not."""

LINK_CHECK_S = 0.1
"""How often a dialler looks whether its link still stands."""


class DiallerOwner:
    """What a dialler needs of the loop that owns it; all on the loop's thread."""

    def call_later(self, delay_s: float, call: Callable[[], None]) -> None:
        """Run call after delay_s."""
        raise NotImplementedError

    def add_link(self, sock: socket.socket, address: Address) -> Optional[Link]:
        """Take over a connected socket; return its link, or None if it was refused or broke already."""
        raise NotImplementedError

    def resolve(self, address: Address, then: Callable[[Optional[Any], str], None]) -> None:
        """Look address up on a thread of its own, then call then(address info or None, error)."""
        raise NotImplementedError

    def watch_dialler(self, dialler: "Dialler", sock: socket.socket) -> None:
        """Call dialler.finish() when sock has connected or failed."""
        raise NotImplementedError

    def unwatch_dialler(self, sock: socket.socket) -> None:
        """Undo watch_dialler()."""
        raise NotImplementedError

    def report_trouble(self, text: str) -> None:
        """Tell the user."""
        raise NotImplementedError


class Dialler:
    """Dials one robot that is a server, again and again with back-off while it is away."""

    def __init__(self, loop: DiallerOwner, address: Address) -> None:
        self._loop = loop
        self._address = address
        self._backoff_s = BACKOFF_FIRST_S
        self._socket: Optional[socket.socket] = None
        self._link: Optional[Link] = None
        self._opened_s = 0.0
        self._attempt = 0
        self._reported = ""

    def dial(self) -> None:
        """Try once; from then on the dialler goes on by itself."""
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
        self._link = self._loop.add_link(sock, self._address)
        self._opened_s = time.monotonic()
        self._reported = ""
        self._watch_link()

    def _connect(self, info: Optional[Any], error: str) -> None:
        if info is None:
            self._retry(error)
            return
        family, kind, protocol, _, target = info
        try:
            sock = socket.socket(family, kind, protocol)
        except OSError as no_file:
            self._retry(describe_error(no_file))
            return
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
        self._loop.call_later(CONNECT_TIMEOUT_S, lambda: self._give_up(attempt))

    def _give_up(self, attempt: int) -> None:
        if self._socket is not None and attempt == self._attempt:
            self._loop.unwatch_dialler(self._socket)
            self._socket.close()
            self._socket = None
            self._retry("no answer within %.0f s" % CONNECT_TIMEOUT_S)

    def _retry(self, error: str) -> None:
        if error != self._reported:
            self._reported = error
            self._loop.report_trouble(
                "robot at %s cannot be reached: %s; dialling again, check that it is on and that host and port"
                " in ~robots are right" % (self._address, error)
            )
        self._dial_later()

    def _dial_later(self) -> None:
        self._loop.call_later(self._backoff_s, self.dial)
        self._backoff_s = min(2 * self._backoff_s, BACKOFF_MAX_S)

    def _watch_link(self) -> None:
        if self._link is None or self._link.closed:
            if time.monotonic() - self._opened_s >= STOOD_S:
                self._backoff_s = BACKOFF_FIRST_S
            self._dial_later()
        else:
            self._loop.call_later(LINK_CHECK_S, self._watch_link)


def start_resolving(address: Address, then: Callable[[Optional[Any], str], None]) -> None:
    """Look address up on a thread of its own, then call then(address info or None, error) on that.

    A look-up may take many seconds, and no other robot waits for it; a dialler makes one at a time.
    """

    def resolve() -> None:
        try:
            info = find_socket_address(address)
        except HostNotFoundError as error:
            then(None, str(error))
        else:
            then(info, "")

    threading.Thread(target=resolve, name="resolver", daemon=True).start()
