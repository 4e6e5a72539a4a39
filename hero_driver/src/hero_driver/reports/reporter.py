"""Publishes the state of the fleet: ~robots (hero_msgs/RobotArray, latched) and /diagnostics (REP 107).

Runs on the main thread of the node; gets the states as values from the thread of the sockets.
"""

import functools
from typing import Any, Dict, List, NamedTuple, Tuple

import diagnostic_updater
import rospy
from diagnostic_msgs.msg import DiagnosticStatus

from hero_msgs.msg import Robot, RobotArray

from ..commands.stop_progress import StopState
from ..fleet.registry import RobotState
from .robot_status import RobotStatus


class FleetStatus(NamedTuple):
    """The state of one driver and its robots at one moment."""

    now_s: float  # monotonic, when it was put together
    message: RobotArray  # as on ~robots, but without its robots
    robots: List[RobotStatus]
    connections: int
    refused_connections: int
    last_refusal: str


class Reporter:
    """The publishers of both reports."""

    def __init__(self) -> None:
        """Advertise both."""
        self._publisher = rospy.Publisher("~robots", RobotArray, queue_size=5, latch=True)
        self._updater = diagnostic_updater.Updater()
        self._updater.setHardwareID("hero swarm")
        self._updater.add("driver", self._diagnose_driver)
        self._known: Dict[str, RobotStatus] = {}
        self._counts: Dict[str, Tuple[int, int]] = {}  # packets and bytes of each robot at _counted_s
        self._counted_s = 0.0
        self._rates: Dict[str, Tuple[float, float]] = {}
        self._status = FleetStatus(0.0, RobotArray(), [], 0, 0, "")

    def publish(self, status: FleetStatus) -> None:
        """Publish status as ~robots, and keep it for /diagnostics."""
        self._status = status
        status.message.header.stamp = rospy.Time.now()
        for robot in status.robots:
            row = robot.message
            row.packets_per_s, row.bytes_per_s = self._rates.get(robot.name, (0.0, 0.0))
            status.message.robots += [row, *robot.duplicates]
        self._publisher.publish(status.message)

    def measure_rates(self, status: FleetStatus) -> None:
        """Take the rates since the last call; once per report period."""
        elapsed_s = status.now_s - self._counted_s
        before, self._counted_s = self._counts, status.now_s
        self._counts = {robot.name: (robot.packets, robot.received_length) for robot in status.robots}
        self._rates = {
            name: ((packets - before[name][0]) / elapsed_s, (length - before[name][1]) / elapsed_s)
            for name, (packets, length) in self._counts.items()
            if name in before
        }

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
        report = status.message
        ready = sum(robot.message.state == Robot.READY for robot in status.robots)
        text = "%d of %d robots connected" % (ready, len(status.robots) + len(report.gone))
        if report.gone:
            text += "; gone: " + ", ".join(robot.namespace.lstrip("/") for robot in report.gone)
        moving = [robot.name for robot in status.robots if robot.message.stop_state == Robot.MOVING]
        if moving:
            stat.summary(DiagnosticStatus.ERROR, f"{text}; moving though stopped: {', '.join(moving)}")
        elif report.stopped:
            stat.summary(DiagnosticStatus.WARN, text + "; all robots are stopped (~stop)")
        else:
            stat.summary(DiagnosticStatus.OK, text)
        stat.add("listening", report.listening)
        stat.add("connections", status.connections)
        stat.add("refused connections", status.refused_connections)
        stat.add("last refusal", status.last_refusal)
        return stat

    def _diagnose_robot(self, name: str, stat: Any) -> Any:
        robot = self._known[name]
        row = robot.message
        stat.summary(robot.level, robot.text)
        shown = {field: getattr(row, field) for field in row.__slots__}
        shown.update(state=RobotState(row.state).name, stop_state=StopState(row.stop_state).name)
        shown.update(since=row.since.to_sec(), uptime=row.uptime.to_sec(), **robot.details)
        shown["refused duplicates"] = "; ".join(duplicate.last_error for duplicate in robot.duplicates)
        for key, value in shown.items():
            stat.add(key, value)
        return stat
