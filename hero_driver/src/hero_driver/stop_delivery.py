"""Stops robots, and confirms by their wheels that they are at rest.

One stop is one write with a zero for every motion topic that the robot declared, whatever was used before. It is
repeated until the robot's wheels are at rest, because the firmware drops a Twist that comes within 50 ms of the last
one (VelocityControl.ino:159), and because only the wheels show what a robot has taken. The two controllers know nothing
of each other, so each gets its zero. Servo pulses of 1500 us come in front of the first zeros only: they let a wheel
creep whose servo has another center, until a zero Twist takes the pulses away.

A robot that tunes itself (pid_calibration) drops every zero within 50 ms of its controller's last run, and that runs
every 21 ms. Only a read that takes longer lets a zero through: TUNING_PULSES servo pulses (0.5 ms each) and the zeros
in one write, small enough for the robot's TCP window of 2144 bytes. Measured with the stock firmware: 110 pulses ended
the tuning in 9 of 9 tries, 60 in 1 of 6.

Runs on the thread of the sockets and never blocks, except stop_without_loop(), for when that thread's loop has broken.
"""

import time
from typing import Callable, Iterable, List, Optional

from .commands.stop_progress import StopProgress, StopState
from .commands.velocity_shaper import COMMAND_INTERVAL_S
from .peer import Peer
from .rosserial.errors import RosserialError

TUNING_PULSES = 140
"""Servo pulses in front of the zeros: 70 ms of the robot's reading cycle, 1680 of its window's 2144 bytes."""

POLL_S = 0.02
REST_POLL_S = 0.1


class StopDelivery:
    """The stops of all robots of one driver."""

    def __init__(
        self,
        call_later: Callable[[float, Callable[[], None]], None],
        is_stopped: Callable[[], bool],
        on_change: Callable[[], None],
        warn_robot: Callable[[Peer, str], None],
    ) -> None:
        """call_later(delay_s, call) is the loop's; is_stopped(): whether all robots are stopped until released.

        on_change() is told of every change of a robot's state; warn_robot(peer, text) logs.
        """
        self._call_later = call_later
        self._is_stopped = is_stopped
        self._on_change = on_change
        self._warn_robot = warn_robot
        self._peers: List[Peer] = []
        self._is_scheduled = False

    def begin(self, peer: Peer) -> None:
        """Stop one robot; the first stop is written before this returns."""
        if peer.bridge is None or peer.link.closed:
            return
        now_s = time.monotonic()
        peer.bridge.forget_motion()
        if peer.stop is None:
            peer.stop = StopProgress(now_s, peer.bridge.wheels)
            self._peers.append(peer)
        else:
            peer.stop.renew(now_s)
        self._advance(peer, now_s)
        if not self._is_scheduled:
            self._is_scheduled = True
            self._call_later(POLL_S, self._poll)
        self._on_change()

    def release(self) -> None:
        """Let all robots move again."""
        for peer in self._peers:
            peer.stop = None
        self._peers.clear()

    def find_state(self, peer: Optional[Peer]) -> StopState:
        """Return what is known of the stop of a robot; peer is None for one that is away."""
        if peer is not None and peer.stop is not None:
            return peer.stop.state
        return StopState.STOPPING if self._is_stopped() else StopState.NOT_STOPPED

    def await_rest(
        self, peers: Iterable[Peer], deadline_s: float, then: Callable[[List[Peer]], None]
    ) -> None:
        """Call then(peers that are not known to be at rest) when all peers are at rest, or at deadline_s."""
        waiting = list(peers)

        def check() -> None:
            if time.monotonic() < deadline_s and any(map(_is_pending, waiting)):
                self._call_later(POLL_S, check)
            else:
                then([peer for peer in waiting if _is_doubtful(peer)])

        check()

    def stop_without_loop(
        self, peers: Iterable[Peer], deadline_s: float, read: Callable[[Peer], None]
    ) -> List[Peer]:
        """Stop all peers although the loop has broken; return those that are not known to be at rest.

        read(peer) takes what a robot has sent. Blocks until all are at rest, or until deadline_s.
        """
        waiting = list(peers)
        for peer in waiting:
            self.begin(peer)
        while time.monotonic() < deadline_s and any(map(_is_pending, waiting)):
            time.sleep(POLL_S)
            for peer in waiting:
                read(peer)
                self._advance(peer, time.monotonic())
        return [peer for peer in waiting if _is_doubtful(peer)]

    def _poll(self) -> None:
        now_s = time.monotonic()
        is_stopped = self._is_stopped()
        for peer in self._peers:
            if peer.stop is None or peer.link.closed or peer.bridge is None:
                continue
            # A stop of this robot alone is over when it is driven again, or at rest.
            if is_stopped or not peer.bridge.is_commanded:
                self._advance(peer, now_s)
                if is_stopped or _is_pending(peer):
                    continue
            peer.stop = None
            self._on_change()
        self._peers = [peer for peer in self._peers if peer.stop is not None and not peer.link.closed]
        self._is_scheduled = bool(self._peers)
        if self._is_scheduled:
            is_urgent = any(map(_is_pending, self._peers))
            self._call_later(POLL_S if is_urgent else REST_POLL_S, self._poll)

    def _advance(self, peer: Peer, now_s: float) -> None:
        stop = peer.stop
        if stop is None or peer.link.closed or peer.bridge is None:
            return
        before = stop.state
        if stop.is_due(peer.has_acknowledged_motion(), now_s):
            burst = stop.needs_burst(peer.bridge.tunes(now_s), now_s)
            self._send(peer, TUNING_PULSES if burst else int(stop.is_first), now_s)
            stop.note_sent(burst, now_s)
        if stop.state is not before:
            if stop.state is StopState.MOVING:
                self._warn_robot(peer, "its wheels turn although it was stopped")
            self._on_change()

    @staticmethod
    def _send(peer: Peer, pulses: int, now_s: float) -> None:
        """Write one stop in one piece, with servo pulses of 1500 us in front."""
        assert peer.bridge is not None
        packets = []
        for topic_id, payload in peer.bridge.list_stops(pulses):
            try:
                packets.append(peer.session.encode_message(topic_id, payload))
            except RosserialError:
                # This connection has not declared the topic again yet, so nothing can drive the robot by it.
                continue
        if packets:
            peer.link.send_packet(b"".join(packets))
            peer.motion_mark = peer.link.handed_length
            peer.bridge.commands.discard_motion(now_s + COMMAND_INTERVAL_S)


def _is_pending(peer: Peer) -> bool:
    """Return whether more may come to be known of a robot's stop soon."""
    if peer.stop is None or peer.link.closed:
        return False
    return peer.stop.state not in (StopState.AT_REST, StopState.UNCONFIRMED)


def _is_doubtful(peer: Peer) -> bool:
    return peer.stop is not None and peer.stop.state is not StopState.AT_REST


def describe_doubt(peer: Peer) -> str:
    """Return why a robot is not known to be at rest."""
    if peer.link.closed:
        return "its connection ended"
    if peer.stop is not None and peer.stop.state is StopState.MOVING:
        return "its wheels turn"
    if peer.stop is not None and peer.stop.state is StopState.UNCONFIRMED:
        return "it sends no readings of its wheels"
    return "it does not answer"
