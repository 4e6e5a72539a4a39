"""States of robots and of stops in drivers' reports (hero_msgs), in the words of all programs. Pure.

A test compares the numbers. Reports stand for any object with the fields of hero_msgs/RobotArray.
"""

from datetime import datetime
from typing import Any, Dict, List

STATES = {0: "JOINING", 1: "READY", 2: "AWAY", 3: "REFUSED"}
STOP_STATES = {0: "", 1: "stopping", 2: "at rest", 3: "MOVING", 4: "unconfirmed"}

COUNTED_AS = {"JOINING": "joining", "READY": "ready", "STOPPED": "stopped", "AWAY": "lost"}


def name_state(robot: Any, stopped: bool) -> str:
    """Return JOINING, READY (can be driven), STOPPED, AWAY or REFUSED; stopped: whether all robots are."""
    state = STATES.get(robot.state, str(robot.state))
    return "STOPPED" if state == "READY" and stopped else state


def describe_counts(report: Any) -> str:
    """Return how many robots are ready, joining, stopped and lost; robots that are gone are lost, too."""
    counts = {name: 0 for name in COUNTED_AS.values()}
    for robot in report.robots:
        name = COUNTED_AS.get(name_state(robot, report.stopped))
        if name is not None:  # a refused connection is not another robot
            counts[name] += 1
    counts["lost"] += len(report.gone)
    others = [f"{count} {name}" for name, count in counts.items() if count and name != "ready"]
    return ", ".join([f"{counts['ready']} of {sum(counts.values())} robots ready", *others])


def describe_gone(report: Any, now_s: float) -> str:
    """Return the robots that have not returned and since when, such as "3, 7 gone since 18:43"; empty without any."""
    by_time: Dict[str, List[str]] = {}
    for robot in sorted(report.gone, key=lambda robot: (robot.since.to_sec(), robot.id)):
        name = str(robot.id) if robot.id >= 0 else robot.namespace.strip("/")
        by_time.setdefault(_format_since(report, robot.since, now_s), []).append(name)
    return "; ".join(f"{', '.join(names)} gone{since}" for since, names in by_time.items())


def describe_stop_origin(report: Any, now_s: float) -> str:
    """Return who stopped the robots and since when, such as "by teleop since 18:43"; empty if they are not stopped."""
    if not report.stopped:
        return ""
    since = _format_since(report, report.stopped_since, now_s)
    by = report.stopped_by.replace("/", " ").strip()
    return f"by {by}{since}" if by else f"{since}, before the driver's start".strip(" ,")


def _format_since(report: Any, stamp: Any, now_s: float) -> str:
    """Return " since" and the time of day of a stamp of a report, with the date if that is another; empty if unknown.

    now_s: of this PC, s since 1970. Stamps count from there, too, but with /clock in another time.
    """
    if not stamp.to_sec():
        return ""
    then = datetime.fromtimestamp(now_s - (report.header.stamp.to_sec() - stamp.to_sec()))
    is_today = then.date() == datetime.fromtimestamp(now_s).date()
    return " since " + then.strftime("%H:%M" if is_today else "%Y-%m-%d %H:%M")
