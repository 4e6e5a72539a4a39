"""Reports of several drivers (hero_msgs/RobotArray) as one, with numbers that can be shown. Knows no topic."""

import math
from typing import Any, Dict, Iterable, List, Set

from hero_msgs.msg import Robot, RobotArray

PREFERENCE = (Robot.READY, Robot.JOINING, Robot.AWAY)
"""Of a robot that went from one driver to another, the entry that counts."""

SUFFIX = "/robots"

MAX_RATE = 1e9
"""Messages or bytes per second; a larger number is a mistake."""


def find_drivers(system_state: Any, topics: Iterable[str]) -> Set[str]:
    """Return those of the topics that are reports of drivers.

    A driver is a node that publishes NAME/robots and offers the service NAME/stop, where NAME is its own. A robot can
    declare such topics and services, but they are those of its driver's node.

    system_state: what the ROS master answers to getSystemState.
    """
    publishers, _, services = (dict(part) for part in system_state)
    names = {topic: driver_of(topic) for topic in topics}
    return {
        topic
        for topic, name in names.items()
        if name in publishers.get(topic, ()) and name in services.get(name + "/stop", ())
    }


def driver_of(topic: str) -> str:
    """Return the name of the driver that has this topic."""
    return topic.rpartition("/")[0]


def clean(report: RobotArray) -> RobotArray:
    """Replace numbers that nobody can show: rates by 0, clock offsets by NaN, which stands for unknown."""
    for robot in report.robots:
        robot.packets_per_s = robot.packets_per_s if 0.0 <= robot.packets_per_s <= MAX_RATE else 0.0
        robot.bytes_per_s = robot.bytes_per_s if 0.0 <= robot.bytes_per_s <= MAX_RATE else 0.0
        robot.clock_offset = robot.clock_offset if abs(robot.clock_offset) <= MAX_RATE else math.nan
    return report


def merge(reports: List[RobotArray]) -> RobotArray:
    """Return one report for several drivers: stopped if all of them are, and each robot once, by namespace."""
    merged = RobotArray()
    merged.header.stamp = max(report.header.stamp for report in reports)
    merged.listening = ", ".join(sorted(report.listening for report in reports if report.listening))
    merged.stopped = all(report.stopped for report in reports)
    by_name: Dict[str, Robot] = {}
    for robot in (robot for report in reports for robot in report.robots):
        # Who was refused, or has not said its name, is not the robot of that name.
        own = robot.namespace if robot.namespace and robot.state in PREFERENCE else None
        key = own or "%s at %s" % (robot.namespace, robot.address)
        known = by_name.get(key)
        if known is None or own is None or PREFERENCE.index(robot.state) < PREFERENCE.index(known.state):
            by_name[key] = robot
    merged.robots = sorted(by_name.values(), key=lambda robot: (robot.namespace, robot.address))
    return merged
