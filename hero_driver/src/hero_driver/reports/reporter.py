"""Publishes the state of the fleet: ~robots (hero_msgs/RobotArray, latched) and /diagnostics (REP 107).

Runs on the main thread of the node; gets the states as values from the thread of the sockets.
"""

import functools
from typing import Any, Dict, List, NamedTuple, Optional, Tuple

import diagnostic_updater
import rospy
from diagnostic_msgs.msg import DiagnosticStatus

from hero_msgs.msg import Robot, RobotArray

from ..commands.stop_progress import StopState
from ..fleet.registry import RobotState
from .robot_status import RobotStatus

LARGE_CLOCK_OFFSET_S = 0.5
"""Beyond it stamps of the robot are of little use; the figures that were published stay below 0.1 s."""


class FleetStatus(NamedTuple):
    """The state of one driver and its robots at one moment."""

    now_s: float  # monotonic, when it was put together
    listening: str
    stopped: bool
    stopped_by: str
    stopped_s: Optional[float]  # monotonic, since when; None: not stopped, or unknown
    connections: int
    refused_connections: int
    last_refusal: str
    robots: List[RobotStatus]
    gone: List[RobotStatus]


class Reporter:
    """The publishers of both reports."""

    def __init__(self) -> None:
        self._publisher = rospy.Publisher("~robots", RobotArray, queue_size=5, latch=True)
        self._updater = diagnostic_updater.Updater()
        self._updater.setHardwareID("hero swarm")
        self._updater.add("driver", self._diagnose_driver)
        self._known: Dict[str, RobotStatus] = {}
        self._rates: Dict[str, Tuple[float, float]] = {}
        self._last_counts: Dict[str, Tuple[float, int, int]] = {}
        self._status = FleetStatus(0.0, "", False, "", None, 0, 0, "", [], [])

    def publish(self, status: FleetStatus) -> None:
        """Publish status as ~robots, and keep it for /diagnostics."""
        self._status = status
        ros_now = rospy.Time.now()
        message = RobotArray(listening=status.listening, stopped=status.stopped, stopped_by=status.stopped_by)
        message.header.stamp = ros_now

        def stamp_of(time_s: float) -> rospy.Time:
            age = rospy.Duration.from_sec(max(0.0, status.now_s - time_s))
            return ros_now - age if ros_now.to_sec() > age.to_sec() else rospy.Time(0)

        if status.stopped_s is not None:
            message.stopped_since = stamp_of(status.stopped_s)
        for robot in status.gone:
            robot.message.since = stamp_of(robot.since_s)
            message.gone.append(robot.message)
        for robot in status.robots:
            row = robot.message
            row.since = stamp_of(robot.since_s)
            row.packets_per_s, row.bytes_per_s = self._rates.get(row.namespace, (0.0, 0.0))
            message.robots.append(row)
            message.robots += [
                Robot(
                    id=row.id,
                    namespace=row.namespace,
                    address=address,
                    state=Robot.REFUSED,
                    stop_state=stop_state.value,
                    last_error=reason,
                )
                for address, reason, stop_state in robot.duplicates
            ]
        self._publisher.publish(message)

    def measure_rates(self, status: FleetStatus) -> None:
        """Take the rates since the last call; once per report period."""
        for robot in status.robots:
            namespace = robot.message.namespace
            last = self._last_counts.get(namespace)
            if last is not None and status.now_s > last[0]:
                elapsed_s = status.now_s - last[0]
                self._rates[namespace] = (
                    (robot.packets - last[1]) / elapsed_s,
                    (robot.received_length - last[2]) / elapsed_s,
                )
            self._last_counts[namespace] = (status.now_s, robot.packets, robot.received_length)
        for namespace in set(self._last_counts) - {robot.message.namespace for robot in status.robots}:
            del self._last_counts[namespace]
            self._rates.pop(namespace, None)

    def diagnose(self) -> None:
        """Publish /diagnostics, if there are subscribers."""
        robots = {robot.name: robot for robot in self._status.robots}
        for name in set(self._known) - set(robots):
            self._updater.removeByName(name)
        for name in sorted(set(robots) - set(self._known)):
            self._updater.add(name, functools.partial(self._diagnose_robot, name))
        self._known = robots
        if self._updater.publisher.get_num_connections():
            self._updater.force_update()

    def _diagnose_driver(self, stat: Any) -> Any:
        status = self._status
        ready = sum(robot.message.state == Robot.READY for robot in status.robots)
        text = "%d of %d robots connected" % (ready, len(status.robots) + len(status.gone))
        if status.gone:
            text += "; gone: " + ", ".join(robot.name for robot in status.gone)
        moving = [robot.name for robot in status.robots if robot.message.stop_state == Robot.MOVING]
        if moving:
            stat.summary(DiagnosticStatus.ERROR, f"{text}; moving though stopped: {', '.join(moving)}")
        elif status.stopped:
            stat.summary(DiagnosticStatus.WARN, text + "; all robots are stopped (~stop)")
        else:
            stat.summary(DiagnosticStatus.OK, text)
        stat.add("listening", status.listening)
        stat.add("connections", status.connections)
        stat.add("refused connections", status.refused_connections)
        stat.add("last refusal", status.last_refusal)
        return stat

    def _diagnose_robot(self, name: str, stat: Any) -> Any:
        robot = self._known[name]
        row = robot.message
        stat.summary(*_assess(robot))
        for key, value in (
            ("address", row.address),
            ("state", RobotState(row.state).name),
            ("stop", StopState(row.stop_state).name),
            ("firmware", row.firmware),
            ("hardware", row.hardware),
            ("config", row.config),
            ("uptime (s)", f"{row.uptime.to_sec():.0f}"),
            ("reconnects", row.reconnects),
            ("packets per second", f"{row.packets_per_s:.1f}"),
            ("bytes per second", f"{row.bytes_per_s:.0f}"),
            ("dropped messages", row.dropped_messages),
            ("bad packets", row.bad_packets),
            ("clock offset (s)", f"{row.clock_offset:.4f}"),
            ("corrected stamps", robot.corrected_stamps),
            ("odometry resets", robot.odometry_resets),
            ("refused transforms", ", ".join(robot.foreign_frames)),
            ("refused duplicates", "; ".join(reason for _, reason, _ in robot.duplicates)),
            ("last error", row.last_error),
        ):
            stat.add(key, value)
        return stat


def _assess(robot: RobotStatus) -> Tuple[int, str]:
    """Return level and text of a robot's diagnostic status."""
    row = robot.message
    if row.stop_state == Robot.MOVING:
        return DiagnosticStatus.ERROR, "its wheels turn although it was stopped"
    if robot.duplicates:
        return DiagnosticStatus.ERROR, robot.duplicates[0][1]
    if robot.problem:
        return DiagnosticStatus.ERROR, robot.problem
    if row.state == Robot.AWAY:
        return DiagnosticStatus.ERROR, f"away: {row.last_error}"
    if row.state == Robot.JOINING:
        return DiagnosticStatus.WARN, "joining"
    if robot.tunes:
        return DiagnosticStatus.WARN, "tunes itself (pid_calibration) and spins; ~stop ends that"
    if robot.foreign_frames:
        return DiagnosticStatus.WARN, f"sends transforms that are not its own: {', '.join(robot.foreign_frames)}"
    if abs(row.clock_offset) > LARGE_CLOCK_OFFSET_S:
        return DiagnosticStatus.WARN, f"its clock is off by {row.clock_offset:.2f} s"
    if robot.command_fault or robot.calibration_problem:
        return DiagnosticStatus.WARN, robot.command_fault or robot.calibration_problem
    return DiagnosticStatus.OK, "ready"
