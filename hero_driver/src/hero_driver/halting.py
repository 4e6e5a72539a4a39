"""Robots that are told to stop -> the moment at which they have, as far as it can be known from here.

Runs on the thread of the sockets, never blocks (halt_directly() is for when that thread has broken).
"""

import time
from typing import Callable, Iterable, List

from .command_shaping import COMMAND_INTERVAL_S
from .robot_status import Peer
from .transport import EventLoop

HALT_SETTLE_S = 0.12
"""After a robot's TCP has acknowledged a stop, its firmware may need two read cycles of 51 ms to take it."""

CHECK_PERIOD_S = 0.02


def await_halt(
    loop: EventLoop, list_peers: Callable[[], List[Peer]], deadline_s: float, then: Callable[[], None]
) -> None:
    """Call then() when all peers have got their stop twice, or at deadline_s (monotonic)."""

    def check() -> None:
        if time.monotonic() < deadline_s and not all(map(has_halted, list_peers())):
            loop.call_later(CHECK_PERIOD_S, check)
        else:
            loop.call_later(HALT_SETTLE_S, then)

    check()


def has_halted(peer: Peer) -> bool:
    """Return whether a robot's TCP has acknowledged all that was to be sent."""
    if peer.bridge is None:
        return True
    return peer.bridge.commands.is_idle and peer.link.read_unacknowledged_length() == 0


def halt_directly(peers: Iterable[Peer]) -> None:
    """Write stops to every robot past all queues, because the loop that empties them has broken.

    Twice, as every stop, and once more: the first may come too soon after a motion.
    """
    for _ in range(3):
        for peer in peers:
            if peer.bridge is not None:
                for topic_id, payload in peer.bridge.encode_stops():
                    peer.link.send_frame(peer.session.encode_message(topic_id, payload))
        time.sleep(COMMAND_INTERVAL_S)
