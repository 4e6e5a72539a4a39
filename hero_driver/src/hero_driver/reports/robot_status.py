"""Collects the state of one robot for reports. Runs on the event loop's thread."""

from typing import Any, List, Mapping, NamedTuple, Optional

import rospy
from diagnostic_msgs.msg import DiagnosticStatus

from hero_msgs.msg import Robot

from ..commands.stop_progress import StopState
from ..fleet.registry import RobotRecord
from ..peer import Peer
from ..ros.robot_bridge import RobotBridge

DUPLICATES_SHOWN = 8
"""Duplicates of one robot in reports: one address could fill them with hundreds."""

LARGE_CLOCK_OFFSET_S = 0.5
"""Beyond it stamps of the robot are of little use; the figures that were published stay below 0.1 s."""


class RobotStatus(NamedTuple):
    """The state of one robot at one moment; counters count from its arrival."""

    message: Robot  # as on ~robots, but without the rates
    duplicates: List[Robot]  # refused connections of robots with its id that wait, as on ~robots
    packets: int
    received_length: int
    level: int
    """DiagnosticStatus.OK, WARN or ERROR."""
    text: str
    """Fault, or "ready"."""
    details: Mapping[str, Any]
    """Further values by their names in diagnostics."""

    @property
    def name(self) -> str:
        """The robot's name without slash, for users."""
        return str(self.message.namespace).lstrip("/")


def find_stamp(time_s: float, now_s: float) -> rospy.Time:
    """Return the ROS time of a moment in the past; both times are monotonic."""
    ros_now, age = rospy.Time.now(), rospy.Duration.from_sec(max(0.0, now_s - time_s))
    return ros_now - age if ros_now.to_sec() > age.to_sec() else rospy.Time(0)


def describe_robot(
    record: RobotRecord,
    bridge: Optional[RobotBridge],
    peer: Optional[Peer],
    stop_state: StopState,
    duplicate_stops: Mapping[str, StopState],
    now_s: float,
) -> RobotStatus:
    """Return the state of a robot; duplicate_stops: by the addresses of refused connections."""
    row = Robot(
        id=record.identity.number,
        namespace=record.identity.namespace,
        address=record.address,
        state=record.state.value,
        since=find_stamp(record.since_s, now_s),
        stop_state=stop_state.value,
        firmware=record.firmware,
        hardware=record.hardware,
        config=record.config,
        uptime=rospy.Duration.from_sec(0.0 if record.booted_s is None or peer is None else now_s - record.booted_s),
        reconnects=record.reconnects,
        dropped_messages=record.dropped_messages,
        bad_packets=record.bad_packets,
    )
    duplicates = [
        Robot(
            id=row.id,
            namespace=row.namespace,
            address=address,
            state=Robot.REFUSED,
            stop_state=duplicate_stops.get(address, StopState.NOT_STOPPED).value,
            last_error=reason,
        )
        for address, reason in sorted(record.refused.items())[:DUPLICATES_SHOWN]
    ]
    problem = calibration_problem = command_fault = foreign_frames = ""
    tunes, details = False, {}
    if bridge is not None:
        corrections, commands = bridge.corrections, bridge.commands
        row.model, row.clock_offset = corrections.model, corrections.clock_offset_s
        row.dropped_messages += commands.refused + commands.queue.dropped + corrections.refused
        problem, tunes = bridge.endpoints.last_error, commands.tunes(now_s)
        calibration_problem = corrections.calibration_problem
        command_fault = commands.fault if peer is not None else ""
        foreign_frames = ", ".join(sorted(corrections.transforms.foreign_frames))
        details = {
            "corrected stamps": corrections.stamps.corrected,
            "odometry resets": corrections.odometry.ticks.resets,
            "refused transforms": foreign_frames,
        }
    packets, received_length = record.packets, record.received_length
    if peer is not None:
        packets += peer.session.reader.packets
        received_length += peer.link.received_length
        row.bad_packets += peer.session.reader.bad_packets
        row.dropped_messages += peer.session.undeclared_messages
    row.last_error = "; ".join(filter(None, (problem or record.last_error, calibration_problem, command_fault)))
    level, text = DiagnosticStatus.WARN, command_fault or calibration_problem
    if row.stop_state == Robot.MOVING:
        level, text = DiagnosticStatus.ERROR, "its wheels turn although it was stopped"
    elif duplicates or problem:
        level, text = DiagnosticStatus.ERROR, duplicates[0].last_error if duplicates else problem
    elif row.state == Robot.AWAY:
        level, text = DiagnosticStatus.ERROR, f"away: {record.last_error}"
    elif row.state == Robot.JOINING:
        text = "joining"
    elif tunes:
        text = "tunes itself (pid_calibration) and spins; ~stop ends that"
    elif foreign_frames:
        text = f"sends transforms that are not its own: {foreign_frames}"
    elif abs(row.clock_offset) > LARGE_CLOCK_OFFSET_S:
        text = f"its clock is off by {row.clock_offset:.2f} s"
    elif not text:
        level, text = DiagnosticStatus.OK, "ready"
    return RobotStatus(row, duplicates, packets, received_length, level, text, details)
