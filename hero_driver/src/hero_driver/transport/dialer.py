"""Connects to robots that are TCP servers, again and again while they are away; each has its own thread.

Looking a name up and connecting block; the thread hands each connection over to the loop and waits for its end.
"""

import socket
import threading
import time
from typing import Callable

from .link import Address, describe_error, find_socket_address

BACKOFF_FIRST_S = 0.5
BACKOFF_MAX_S = 10.0
CONNECT_TIMEOUT_S = 5.0

STABLE_S = 3.0
"""A connection that lasted this long is dialled again quickly; one that hangs up at once is not."""


HandOver = Callable[[socket.socket, Address, Callable[[], None]], None]
"""Takes a connected socket, its address, and what to call when it is closed again."""


def start_dialer(address: Address, hand_over: HandOver, warn: Callable[[str], None], ended: threading.Event) -> None:
    """Keep a connection to address until ended is set; hand_over() and warn() are called on the dialer's thread."""
    arguments = (address, hand_over, warn, ended)
    threading.Thread(target=_dial_until_end, args=arguments, name="dialer", daemon=True).start()


def _dial_until_end(address: Address, hand_over: HandOver, warn: Callable[[str], None], ended: threading.Event) -> None:
    backoff_s = BACKOFF_FIRST_S
    reported = ""
    while not ended.is_set():
        try:
            sock = _connect(address)
        except OSError as error:
            reason = describe_error(error)
            if reason != reported:
                reported = reason
                warn(
                    "robot at %s cannot be reached: %s; dialling again, check that it is on and that host and port"
                    " in ~robots are right" % (address, reason)
                )
        else:
            reported = ""
            connected_s = time.monotonic()
            closed = threading.Event()
            hand_over(sock, address, closed.set)
            closed.wait()
            if time.monotonic() - connected_s >= STABLE_S:
                backoff_s = BACKOFF_FIRST_S
        ended.wait(backoff_s)
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
