"""Sends the commands that wait and may be sent now; a robot that does not acknowledge delays no other."""

import time

from .peer import Peer
from .ros.robot_commands import Owner
from .rosserial.errors import RosserialError
from .transport.event_loop import CallLater

SILENCE_LIMIT_S = 0.5
"""A robot silent for this long gets motion only when it sends again; pauses of 0.1 s are common on Wi-Fi."""


class CommandSender:
    """The commands that wait in the queues of all robots, on their way to the sockets; on the loop's thread."""

    def __init__(self, call_later: CallLater, owner: Owner) -> None:
        """call_later is the loop's; owner takes warnings about robots."""
        self._call_later = call_later
        self._owner = owner

    def send_commands(self, peer: Peer) -> None:
        """Send the commands of a robot that may go out; retry later with the remainder."""
        if peer.link.closed:
            return
        if peer.send_due:
            # A timer is set already for commands that have to wait.
            self._send_ready(peer, time.monotonic())
        else:
            self._send_and_come_back(peer)

    def _send_and_come_back(self, peer: Peer) -> None:
        peer.send_due = False
        if peer.bridge is None or peer.link.closed:
            return
        now_s = time.monotonic()
        delay_s = peer.bridge.commands.queue.due_in_s(self._send_ready(peer, now_s), now_s)
        if delay_s is not None:
            peer.send_due = True
            self._call_later(delay_s, lambda: self._send_and_come_back(peer))

    def _send_ready(self, peer: Peer, now_s: float) -> bool:
        """Send what may go out; return whether the next motion command may, as far as the robot is concerned."""
        link, bridge = peer.link, peer.bridge
        if bridge is None:
            return True
        if self._owner.stopped:
            # What a thread of rospy's offered just before the stop.
            bridge.commands.queue.discard_motion(now_s)
        stops_only = peer.wheels.readings > 0 and now_s - peer.session.last_receive_s > SILENCE_LIMIT_S
        in_flight = link.read_unacknowledged_length()
        acknowledged = link.handed_length - in_flight >= peer.motion_mark
        for name, payload in bridge.commands.queue.take(in_flight, acknowledged, stops_only, now_s):
            topic_id = bridge.find_id(name)
            if topic_id is None:
                bridge.commands.refused += 1
                continue
            try:
                link.send_packet(peer.session.encode_message(topic_id, payload))
            except RosserialError as error:  # it does not fit
                self._owner.warn_robot(peer, str(error))
            if bridge.is_motion(name):
                peer.motion_mark = link.handed_length
                acknowledged = False
        return acknowledged and not stops_only
