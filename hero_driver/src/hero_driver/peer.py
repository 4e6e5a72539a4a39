"""One connection and what is known of it. Thread of the sockets."""

import time
from dataclasses import dataclass, field
from typing import List, Optional

from hero_node import TokenBucket

from .commands.stop_progress import BurstGate, StopProgress
from .corrections.message_layouts import CONVERSIONS, read_encoder
from .corrections.wheel_motion import WheelMotion
from .fleet import log_lines
from .fleet.admission import RateLimit
from .fleet.registry import RobotRecord
from .ros.robot_bridge import RobotBridge
from .ros.robot_commands import Owner
from .rosserial.packets import RosserialError
from .rosserial.session import Event, Session, Topic
from .transport.event_loop import CallLater
from .transport.link import Link

EARLY_EVENTS_MAX = 18
"""A robot logs a few lines at its start, and declares /tf among its first topics."""

LOG_LINES_PER_S = 100
"""Log lines of one robot that reach /rosout; a robot that tunes its motors sends 47 per second."""

SILENCE_LIMIT_S = 0.5
"""A robot silent for this long gets motion only when it sends again; pauses of 0.1 s are common on Wi-Fi."""


@dataclass
class Peer:
    """One connection and what is known of who is at its other end; call_later is the loop's."""

    link: Link
    session: Session
    rate_limit: RateLimit
    owner: Owner
    call_later: CallLater
    record: Optional[RobotRecord] = None
    bridge: Optional[RobotBridge] = None
    wheels: WheelMotion = field(default_factory=WheelMotion)
    refused: bool = False  # a duplicate: kept open and only stopped, so that it does not dial in 20 times per second
    boot: Optional[log_lines.BootLine] = None
    early: List[Event] = field(default_factory=list)  # log lines, and /tf, before a name that tells who it is
    log_lines: TokenBucket = field(default_factory=lambda: TokenBucket(LOG_LINES_PER_S, LOG_LINES_PER_S, 0.0))
    motion_mark: int = 0  # how much was written when the last motion command was
    send_due: bool = False  # a timer is set for commands that have to wait
    stop: Optional[StopProgress] = None  # while the robot is stopped

    def __post_init__(self) -> None:
        self.bursts = BurstGate(self.wheels)

    @property
    def label(self) -> str:
        """Name of this peer in log lines."""
        if self.bridge is not None:
            return self.bridge.label
        if self.record is not None:
            return f"{self.record.identity.namespace.lstrip('/')} at {self.link.address} (refused)"
        return str(self.link.address)

    def keep(self, event: Event) -> None:
        """Keep an event until it is known which robot this is; of many the first ones."""
        if len(self.early) < EARLY_EVENTS_MAX:
            self.early.append(event)

    def watch_wheels(self, topic: Topic) -> None:
        """Read the wheels of a robot without a bridge from its encoder."""
        if topic.info.message_type.endswith("/Encoder"):
            convert = CONVERSIONS.get(("hero_msgs/Encoder", topic.info.md5sum), bytes)

            def read(payload: bytes, arrival_ns: int) -> None:
                reading = read_encoder(convert(payload))
                if reading is not None:
                    self.wheels.read_ticks(*reading[1:])

            topic.receive = read

    def has_acknowledged_motion(self) -> bool:
        """Return whether the robot's TCP has acknowledged the last motion command."""
        return self.link.handed_length - self.link.read_unacknowledged_length() >= self.motion_mark

    def send_commands(self) -> None:
        """Send the commands that wait and may go out, later the remainder; a robot that reads none delays no other."""
        if self.send_due:
            self._send_ready(time.monotonic())
        else:
            self._send_and_come_back()

    def _send_and_come_back(self) -> None:
        self.send_due = False
        if self.bridge is None or self.link.closed:
            return
        now_s = time.monotonic()
        delay_s = self.bridge.commands.queue.due_in_s(self._send_ready(now_s), now_s)
        if delay_s is not None:
            self.send_due = True
            self.call_later(delay_s, self._send_and_come_back)

    def _send_ready(self, now_s: float) -> bool:
        """Send what may go out; return whether the next motion command may, as far as the robot is concerned."""
        link, bridge = self.link, self.bridge
        if bridge is None or link.closed:
            return True
        if self.owner.stopped:
            # What a thread of rospy's offered just before the stop.
            bridge.commands.queue.discard_motion(now_s)
        stops_only = self.wheels.readings > 0 and now_s - self.session.last_receive_s > SILENCE_LIMIT_S
        in_flight = link.read_unacknowledged_length()
        acknowledged = link.handed_length - in_flight >= self.motion_mark
        for name, payload in bridge.commands.queue.take(in_flight, acknowledged, stops_only, now_s):
            topic_id = bridge.ids.get(name)
            if topic_id is None:
                bridge.commands.refused += 1
                continue
            try:
                link.send_packet(self.session.encode_message(topic_id, payload))
            except RosserialError as error:  # it does not fit
                self.owner.warn_robot(self, str(error))
            if bridge.is_motion(name):
                self.motion_mark = link.handed_length
                acknowledged = False
        return acknowledged and not stops_only
