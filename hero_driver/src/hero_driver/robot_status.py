"""What is known of one connection and of one robot, put together for reports. Thread of the sockets."""

from dataclasses import dataclass, field
from typing import List, Optional

from . import log_lines
from .admission import RateGuard
from .fleet import RobotRecord, RobotState
from .robot_bridge import RobotBridge
from .rosserial.payloads import Log
from .rosserial.session import Session, Topic
from .transport import Link


@dataclass
class Peer:
    """One connection and what is known of who is at its other end."""

    link: Link
    session: Session
    guard: RateGuard
    record: Optional[RobotRecord] = None
    bridge: Optional[RobotBridge] = None
    refused: bool = (
        False  # a duplicate: kept open and ignored, so that it does not dial in 20 times per second
    )
    boot: Optional[log_lines.BootLine] = None
    early_logs: List[Log] = field(default_factory=list)
    early_topics: List[Topic] = field(default_factory=list)  # /tf, declared before a name that tells who it is
    log_window_s: float = 0.0
    log_count: int = 0
    velocity_mark: int = 0  # how much was written when the last velocity was
    send_due: bool = False

    @property
    def label(self) -> str:
        """How log lines call this peer."""
        if self.bridge is not None:
            return self.bridge.label
        return str(self.link.address)


@dataclass(frozen=True)
class RobotStatus:
    """The state of one robot at one moment; counters count from its arrival, times are monotonic."""

    namespace: str
    number: int
    address: str
    state: RobotState
    firmware: str
    hardware: str
    config: str
    since_s: float
    uptime_s: float  # 0 while not known
    reconnects: int
    frames: int
    received_length: int
    dropped_messages: int
    bad_frames: int
    clock_offset_s: float
    corrected_stamps: int
    odometry_resets: int
    last_error: str
    complaint: str  # what is wrong now; empty if nothing is
    foreign_frames: List[str]
    refused: List[str]  # one text for each duplicate that waits


def describe_robot(
    record: RobotRecord, bridge: Optional[RobotBridge], peer: Optional[Peer], now_s: float
) -> RobotStatus:
    """Return the state of the robot that record tells of; bridge and peer are its own, where it has them."""
    cleaner = None if bridge is None else bridge.cleaner
    dropped = record.dropped_messages
    complaint = ""
    if bridge is not None:
        dropped += bridge.refused_commands + bridge.commands.dropped
        complaint = bridge.last_error
    if cleaner is not None:
        dropped += cleaner.refused
    frames, bad_frames, received_length = record.frames, record.bad_frames, record.received_length
    if peer is not None:
        frames += peer.session.reader.frames
        bad_frames += peer.session.reader.bad_frames
        dropped += peer.session.undeclared_messages
        received_length += peer.link.received_length
    return RobotStatus(
        namespace=record.identity.namespace,
        number=record.identity.number,
        address=record.address,
        state=record.state,
        firmware=record.firmware,
        hardware=record.hardware,
        config=record.config,
        since_s=record.since_s,
        uptime_s=0.0 if record.booted_s is None or peer is None else now_s - record.booted_s,
        reconnects=record.reconnects,
        frames=frames,
        received_length=received_length,
        dropped_messages=dropped,
        bad_frames=bad_frames,
        clock_offset_s=0.0 if cleaner is None else cleaner.clock_offset_s,
        corrected_stamps=0 if cleaner is None else cleaner.corrected_stamps,
        odometry_resets=0 if cleaner is None else cleaner.odometry.resets,
        last_error=complaint or record.last_error,
        complaint=complaint,
        foreign_frames=[] if cleaner is None else sorted(cleaner.transforms.foreign_frames),
        refused=sorted(record.refused.values()),
    )
