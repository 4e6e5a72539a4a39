"""Stops robots, and confirms by their wheels that they are at rest. Thread of the sockets.

One stop is one write with a zero for every motion topic that the connection declared. It is repeated until the wheels
rest or a newer command moves the robot: the firmware drops a Twist within 50 ms of the last one
(VelocityControl.ino:159), and only the wheels show what a robot has taken. The two controllers know nothing of each
other, so each gets its zero. A zero Twist also ends servo pulses (cmd_motor): it switches the servos off. Pulses of
1500 us would turn a wheel whose servo has another center, and with the servo timing of ESP8266 Arduino core 3 each
costs the robot 20 ms: only a robot that takes no Twist gets them.

A robot that tunes itself (pid_calibration) drops every zero within 50 ms of its controller's last run, and that runs
every 21 ms. Only a read that takes longer lets a zero through: BURST_LIGHTS light commands (1 ms each) and the zeros in
one write, below the robot's TCP window of 2144 bytes, and no second one before the robot has read the first
(BurstGate). They hold the robot's last color, so that its light stays as it was.
"""

import time
from typing import Callable, List, Optional

from hero_node.ros_messages import MD5SUMS

from ..commands.stop_progress import StopProgress, StopState
from ..commands.velocity_shaper import STOP_PAYLOADS, ZERO_TWIST
from ..peer import Peer
from ..ros.message_types import apply_aliases
from ..ros.robot_commands import LIGHT_SUFFIX, NO_LIGHT, Owner
from ..rosserial.packets import RosserialError
from ..rosserial.session import Topic
from ..transport.event_loop import CallLater

BURST_LIGHTS = 62
"""Light commands in front of the zeros that end a self-tuning: 1488 bytes. Measured: 40 of 40 tunings ended."""

LIGHT_TYPE, LIGHT_MD5 = "std_msgs/ColorRGBA", "a29a96539573343b1310c73607334b00"

MOTION_AFTER_S = 0.1
"""Motion goes out this long after a stop. A program's zero overtakes its own last commands, which come on other
connections; the zero with which it makes sure follows after 0.05 to 0.06 s, and finds them waiting still."""

POLL_S = 0.02
REST_POLL_S = 0.1


def is_light(topic: Topic) -> bool:
    """Return whether a topic that a robot declared sets the color of its light."""
    info = topic.info
    return (info.message_type, info.md5sum) == (LIGHT_TYPE, LIGHT_MD5) and info.name.endswith(LIGHT_SUFFIX)


def find_stop_payload(topic: Topic) -> Optional[bytes]:
    """Return what stops a robot on a topic that it declared, None if the topic does not move it."""
    ros_type = apply_aliases(topic.info.message_type)
    if topic.kind.is_from_robot or topic.info.md5sum != MD5SUMS.get(ros_type):
        return None
    return STOP_PAYLOADS.get(ros_type)


def can_move(peer: Peer) -> bool:
    """Return whether the robot has declared a topic that moves it."""
    return any(find_stop_payload(topic) is not None for topic in peer.session.topics.values())


def encode_stop(peer: Peer, with_burst: bool) -> bytes:
    """Return one stop for every motion topic that the connection declared, empty if there is none."""
    light, motors, twists = b"", b"", b""
    for topic_id, topic in peer.session.topics.items():
        payload = find_stop_payload(topic)
        try:
            if payload is ZERO_TWIST:
                twists += peer.session.encode_message(topic_id, payload)
            elif payload is not None:
                motors += peer.session.encode_message(topic_id, payload)
            elif with_burst and is_light(topic):
                color = NO_LIGHT if peer.bridge is None else peer.bridge.commands.light
                light = peer.session.encode_message(topic_id, color)
        except RosserialError:
            continue  # its buffer is too small for such a message, so nothing can drive the robot by it
    return BURST_LIGHTS * light + (twists or motors)


class StopDelivery:
    """The stops of all robots of one driver."""

    def __init__(self, call_later: CallLater, owner: Owner) -> None:
        """call_later is the loop's; owner is told of what changes and what goes wrong."""
        self._call_later = call_later
        self._owner = owner
        self._peers: List[Peer] = []
        self._is_scheduled = False

    def begin(self, peer: Peer) -> None:
        """Stop one robot; the first stop is written before this returns."""
        if peer.link.closed or not can_move(peer):
            return
        now_s = time.monotonic()
        if peer.bridge is not None:
            peer.bridge.commands.stop()
        if peer.stop is None:
            peer.stop = StopProgress(now_s, peer.wheels)
            self._peers.append(peer)
        else:
            peer.stop.renew(now_s)
        self._advance(peer, now_s)
        if not self._is_scheduled:
            self._is_scheduled = True
            self._call_later(POLL_S, self._poll)
        self._owner.note_change()

    def release(self) -> None:
        """Robots may move: a stop that is over must not end a self-tuning that begins before the next poll."""
        for peer in self._peers:
            if not _is_pending(peer):
                peer.stop = None
        self._peers = [peer for peer in self._peers if peer.stop is not None]

    def find_state(self, peer: Optional[Peer]) -> StopState:
        """Return what is known of the stop of a robot; peer is None for one that is away."""
        if peer is not None and peer.stop is not None:
            return peer.stop.state
        return StopState.STOPPING if self._owner.stopped else StopState.NOT_STOPPED

    def stop_and_wait(self, peers: List[Peer], deadline_s: float, serve: Callable[[Peer], None]) -> List[Peer]:
        """Stop all peers without a loop; return those that are not known to be at rest by deadline_s. Blocks.

        serve(peer) writes what waits for a robot, and takes what it has sent.
        """
        for peer in peers:
            self.begin(peer)
        while time.monotonic() < deadline_s and any(map(_is_pending, peers)):
            time.sleep(POLL_S)
            for peer in peers:
                serve(peer)
                self._advance(peer, time.monotonic())
        return [peer for peer in peers if peer.stop is not None and peer.stop.state is not StopState.AT_REST]

    def _poll(self) -> None:
        now_s = time.monotonic()
        for peer in self._peers:
            if peer.stop is None or peer.link.closed:
                continue
            # While robots may move, a stop is over when the robot is driven again, or at rest.
            is_driven = not self._owner.stopped and peer.bridge is not None and peer.bridge.commands.is_commanded
            if not is_driven:
                self._advance(peer, now_s)
            if is_driven or not (self._owner.stopped or _is_pending(peer)):
                peer.stop = None
                self._owner.note_change()
        self._peers = [peer for peer in self._peers if peer.stop is not None and not peer.link.closed]
        self._is_scheduled = bool(self._peers)
        if self._is_scheduled:
            is_urgent = any(map(_is_pending, self._peers))
            self._call_later(POLL_S if is_urgent else REST_POLL_S, self._poll)

    def _advance(self, peer: Peer, now_s: float) -> None:
        try:
            self._send_due(peer, now_s)
        except Exception as error:  # noqa: BLE001 - an error with one robot must not keep the others moving
            self._owner.report_bug(error)
            peer.link.close("a bug of the driver")

    def _send_due(self, peer: Peer, now_s: float) -> None:
        stop = peer.stop
        if stop is None or peer.link.closed:
            return
        before = stop.state
        is_acknowledged = peer.has_acknowledged_motion()
        may_burst = peer.bursts.is_open(is_acknowledged, now_s)
        if stop.is_due(is_acknowledged, now_s):
            burst = stop.needs_burst(peer.bridge is not None and peer.bridge.commands.tunes(now_s), now_s)
            # The first one goes at once, whatever is on its way.
            if may_burst or not burst or not stop.has_begun:
                self._send(peer, burst and may_burst, now_s)
                stop.note_sent(burst and may_burst, now_s)
        if stop.lacks_evidence(now_s):
            self._owner.warn_late()
        if stop.state is not before:
            if stop.state is StopState.MOVING:
                self._owner.warn_robot(peer, "its wheels turn although it was stopped")
            elif stop.state is StopState.AT_REST and peer.bridge is not None:
                peer.bridge.commands.note_tuning(False)
            self._owner.note_change()

    @staticmethod
    def _send(peer: Peer, with_burst: bool, now_s: float) -> None:
        peer.link.send_packet(encode_stop(peer, with_burst))
        if with_burst:
            peer.bursts.note_sent(now_s)
        peer.motion_mark = peer.link.handed_length
        if peer.bridge is not None:
            peer.bridge.commands.queue.discard_motion(now_s + MOTION_AFTER_S)


def _is_pending(peer: Peer) -> bool:
    """Return whether more may come to be known of a robot's stop soon."""
    if peer.stop is None or peer.link.closed:
        return False
    return peer.stop.state not in (StopState.AT_REST, StopState.UNCONFIRMED)
