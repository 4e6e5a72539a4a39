"""One connection and what is known of it. Thread of the sockets."""

from dataclasses import dataclass, field
from typing import List, Optional

from .commands.burst_gate import BurstGate
from .commands.stop_progress import StopProgress
from .corrections.message_layouts import CONVERSIONS, read_encoder
from .corrections.wheel_motion import WheelMotion
from .fleet import log_lines
from .fleet.admission import RateLimit
from .fleet.registry import RobotRecord
from .ros.robot_bridge import RobotBridge
from .rosserial.payloads import Log
from .rosserial.session import Session, Topic
from .transport.link import Link


@dataclass
class Peer:
    """One connection and what is known of who is at its other end."""

    link: Link
    session: Session
    rate_limit: RateLimit
    record: Optional[RobotRecord] = None
    bridge: Optional[RobotBridge] = None
    wheels: WheelMotion = field(default_factory=WheelMotion)
    refused: bool = False  # a duplicate: kept open and only stopped, so that it does not dial in 20 times per second
    boot: Optional[log_lines.BootLine] = None
    early_logs: List[Log] = field(default_factory=list)
    early_topics: List[Topic] = field(default_factory=list)  # /tf, declared before a name that tells who it is
    log_window_s: float = 0.0
    log_count: int = 0
    motion_mark: int = 0  # how much was written when the last motion command was
    send_due: bool = False
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

    def watch_wheels(self, topic: Topic) -> None:
        """Read the wheels of a robot without a bridge from its encoder."""
        if topic.info.message_type.endswith("/Encoder"):
            convert = CONVERSIONS.get(("hero_msgs/Encoder", topic.info.md5sum), bytes)
            topic.receive = lambda payload, _arrival_ns: self._read_wheels(convert(payload))

    def _read_wheels(self, payload: bytes) -> None:
        reading = read_encoder(payload)
        if reading is not None:
            self.wheels.read_ticks(reading[1], reading[2])

    def has_acknowledged_motion(self) -> bool:
        """Return whether the robot's TCP has acknowledged the last motion command."""
        return self.link.handed_length - self.link.read_unacknowledged_length() >= self.motion_mark
