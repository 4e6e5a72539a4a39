"""Connects to robots that are TCP servers, again and again while they are away; each has its own thread.

Looking a name up and connecting block; the thread hands each connection over to the loop and waits for its end.
"""

import functools
import socket
import threading
import time
from typing import TYPE_CHECKING

from .link import Address, describe_error, find_socket_address

if TYPE_CHECKING:
    from .event_loop import EventLoop

BACKOFF_FIRST_S = 0.5
BACKOFF_MAX_S = 10.0
CONNECT_TIMEOUT_S = 5.0

STABLE_S = 3.0
"""A connection that lasted so long is dialled again quickly; one that hangs up at once is not."""


def start_dialler(loop: "EventLoop", address: Address) -> None:
    """Keep a connection to address until the loop ends."""
    threading.Thread(target=_dial_until_end, args=(loop, address), name="dialler", daemon=True).start()


def _dial_until_end(loop: "EventLoop", address: Address) -> None:
    backoff_s = BACKOFF_FIRST_S
    reported = ""
    while not loop.ended.is_set():
        try:
            sock = _connect(address)
        except OSError as error:
            reason = describe_error(error)
            if reason != reported:
                reported = reason
                loop.report_trouble(
                    "robot at %s cannot be reached: %s; dialling again, check that it is on and that host and port"
                    " in ~robots are right" % (address, reason)
                )
        else:
            reported = ""
            connected_s = time.monotonic()
            closed = threading.Event()
            loop.call_soon(functools.partial(loop.add_link, sock, address, closed.set))
            closed.wait()
            if time.monotonic() - connected_s >= STABLE_S:
                backoff_s = BACKOFF_FIRST_S
        loop.ended.wait(backoff_s)
        backoff_s = min(2 * backoff_s, BACKOFF_MAX_S)


def _connect(address: Address) -> socket.socket:
    """Return a connected socket. Raises: OSError."""
    family, kind, protocol, _, target = find_socket_address(address)
    sock = socket.socket(family, kind, protocol)
    try:
        sock.settimeout(CONNECT_TIMEOUT_S)
        sock.connect(target)
    except OSError:
        sock.close()
        raise
    return sock
