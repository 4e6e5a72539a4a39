"""Collects the state of one robot for reports. Runs on the event loop's thread."""

from dataclasses import dataclass
from typing import List, Mapping, Optional, Tuple

import rospy

from hero_msgs.msg import Robot

from ..commands.stop_progress import StopState
from ..fleet.registry import RobotRecord
from ..peer import Peer
from ..ros.robot_bridge import RobotBridge

DUPLICATES_SHOWN = 8
"""Duplicates of one robot in reports: one address could fill them with hundreds."""


@dataclass(frozen=True)
class RobotStatus:
    """The state of one robot at one moment; counters count from its arrival."""

    message: Robot  # as on ~robots, but without the rates and since
    since_s: float  # monotonic
    packets: int
    received_length: int
    tunes: bool  # whether a controller of the robot tunes itself
    problem: str  # what is wrong now; empty if nothing is
    corrected_stamps: int
    odometry_resets: int
    foreign_frames: List[str]
    duplicates: List[Tuple[str, str, StopState]]  # address, reason and stop of each refused one that waits
    calibration_problem: str  # empty: its calibration file is used, or there is none
    command_fault: str  # empty: nothing is wrong with how it is commanded

    @property
    def name(self) -> str:
        """The robot's name without slash, for users."""
        return str(self.message.namespace).lstrip("/")


def describe_robot(
    record: RobotRecord,
    bridge: Optional[RobotBridge],
    peer: Optional[Peer],
    stop_state: StopState,
    duplicate_stops: Mapping[str, StopState],
    now_s: float,
) -> RobotStatus:
    """Return the state of a robot; duplicate_stops: by the addresses of refused connections."""
    corrections = None if bridge is None else bridge.corrections
    dropped = record.dropped_messages
    problem = calibration_problem = command_fault = ""
    if bridge is not None:
        dropped += bridge.commands.refused + bridge.commands.queue.dropped + bridge.corrections.refused
        problem = bridge.last_error
        calibration_problem = bridge.corrections.calibration_problem
        command_fault = bridge.commands.fault if peer is not None else ""
    packets, bad_packets, received_length = record.packets, record.bad_packets, record.received_length
    if peer is not None:
        packets += peer.session.reader.packets
        bad_packets += peer.session.reader.bad_packets
        dropped += peer.session.undeclared_messages
        received_length += peer.link.received_length
    message = Robot(
        id=record.identity.number,
        namespace=record.identity.namespace,
        address=record.address,
        state=record.state.value,
        stop_state=stop_state.value,
        firmware=record.firmware,
        hardware=record.hardware,
        config=record.config,
        model="" if corrections is None else corrections.models.model,
        uptime=rospy.Duration.from_sec(0.0 if record.booted_s is None or peer is None else now_s - record.booted_s),
        reconnects=record.reconnects,
        dropped_messages=dropped,
        bad_packets=bad_packets,
        clock_offset=0.0 if corrections is None else corrections.clock_offset_s,
        last_error="; ".join(filter(None, (problem or record.last_error, calibration_problem, command_fault))),
    )
    return RobotStatus(
        message,
        record.since_s,
        packets,
        received_length,
        bridge is not None and bridge.commands.tunes(now_s),
        problem,
        0 if corrections is None else corrections.stamps.corrected,
        0 if corrections is None else corrections.odometry.ticks.resets,
        [] if corrections is None else sorted(corrections.transforms.foreign_frames),
        [
            (address, reason, duplicate_stops.get(address, StopState.NOT_STOPPED))
            for address, reason in sorted(record.refused.items())[:DUPLICATES_SHOWN]
        ],
        calibration_problem,
        command_fault,
    )
