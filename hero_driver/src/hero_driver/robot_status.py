"""Collects the state of one robot for reports. Runs on the event loop's thread."""

from dataclasses import dataclass
from typing import List, Optional, Tuple

from .commands.stop_progress import StopState
from .fleet.registry import RobotRecord, RobotState
from .peer import Peer
from .ros.robot_bridge import RobotBridge

DUPLICATES_SHOWN = 8
"""Of one robot, in reports: one address could fill them with hundreds."""


@dataclass(frozen=True)
class RobotStatus:
    """The state of one robot at one moment; counters count from its arrival, times are monotonic."""

    namespace: str
    number: int
    address: str
    state: RobotState
    stop_state: StopState
    tunes: bool  # whether a controller of the robot tunes itself
    firmware: str
    hardware: str
    config: str
    since_s: float
    uptime_s: float  # 0 while not known
    reconnects: int
    packets: int
    received_length: int
    dropped_messages: int
    bad_packets: int
    clock_offset_s: float
    corrected_stamps: int
    odometry_resets: int
    last_error: str
    problem: str  # what is wrong now; empty if nothing is
    foreign_frames: List[str]
    refused: List[Tuple[str, str]]  # address and reason of each duplicate that waits


def describe_robot(
    record: RobotRecord,
    bridge: Optional[RobotBridge],
    peer: Optional[Peer],
    stop_state: StopState,
    now_s: float,
) -> RobotStatus:
    """Return the state of the robot that record tells of; bridge and peer are its own, where it has them."""
    corrections = None if bridge is None else bridge.corrections
    dropped = record.dropped_messages
    problem = ""
    if bridge is not None:
        dropped += bridge.refused_commands + bridge.commands.dropped
        problem = bridge.last_error
    if corrections is not None:
        dropped += corrections.refused
    packets, bad_packets, received_length = record.packets, record.bad_packets, record.received_length
    if peer is not None:
        packets += peer.session.reader.packets
        bad_packets += peer.session.reader.bad_packets
        dropped += peer.session.undeclared_messages
        received_length += peer.link.received_length
    return RobotStatus(
        namespace=record.identity.namespace,
        number=record.identity.number,
        address=record.address,
        state=record.state,
        stop_state=stop_state,
        tunes=bridge is not None and bridge.tunes(now_s),
        firmware=record.firmware,
        hardware=record.hardware,
        config=record.config,
        since_s=record.since_s,
        uptime_s=0.0 if record.booted_s is None or peer is None else now_s - record.booted_s,
        reconnects=record.reconnects,
        packets=packets,
        received_length=received_length,
        dropped_messages=dropped,
        bad_packets=bad_packets,
        clock_offset_s=0.0 if corrections is None else corrections.clock_offset_s,
        corrected_stamps=0 if corrections is None else corrections.corrected_stamps,
        odometry_resets=0 if corrections is None else corrections.odometry.resets,
        last_error=problem or record.last_error,
        problem=problem,
        foreign_frames=[] if corrections is None else sorted(corrections.transforms.foreign_frames),
        refused=sorted(record.refused.items())[:DUPLICATES_SHOWN],
    )
