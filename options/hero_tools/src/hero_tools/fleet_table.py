"""Formats the fleet as lines for a terminal, or as JSON for scripts. Pure.

Texts from robots are stripped of control characters, which could draw on the terminal.
"""

import json
import math
from typing import Any, Dict, List, Optional, Sequence

from hero_client.values import Obstacle, describe_counts, describe_gone, describe_stop_origin, finite
from hero_msgs.msg import Robot, RobotArray
from hero_node import Pose, make_printable
from hero_node.files import ExtraTopic
from hero_node.robot_constants import BEAM_NAMES, BEAMS

from .fleet_rows import RobotRow

HEADINGS = ("ROBOT", "ADDRESS", "STATE", "ODOM", "FROM ROBOT", "POSE x y yaw", "DISTANCE", "NEAREST", "")
RIGHT_ALIGNED = {"ODOM", "FROM ROBOT", "POSE x y yaw", "DISTANCE"}


def format_pose(pose: Optional[Pose]) -> str:
    """Return a pose in m and degrees."""
    if pose is None:
        return "-"
    return f"{pose.x_m:6.2f} {pose.y_m:6.2f} m {math.degrees(pose.yaw_rad):4.0f} deg"


def format_nearest(seen: bool, free: bool, nearest: Optional[Obstacle]) -> str:
    """Return range and direction of the nearest obstacle; seen: whether any scan has arrived."""
    if not seen:
        return "-"
    if nearest is None:
        return "free" if free else "not calibrated"
    where = BEAM_NAMES[round((math.pi + nearest.bearing_rad) / (math.pi / 4)) % BEAMS]
    return f"touch {where}" if nearest.range_m == 0.0 else f"{nearest.range_m:.2f} m {where}"


def format_cells(row: RobotRow, topics: Sequence[ExtraTopic] = ()) -> List[str]:
    """Return one robot's cells, in the order of HEADINGS, with the values of topics before the last one."""
    robot, track = row.robot, row.track
    notes = [row.notes.text, robot.last_error, "reconnected %dx" % robot.reconnects if robot.reconnects else ""]
    is_connected = robot.state in (Robot.READY, Robot.JOINING)
    return [
        make_printable(row.name),
        make_printable(robot.address),
        ", ".join(filter(None, (row.state, row.stop_state))),
        f"{row.odom_hz:.1f} Hz" if is_connected else "-",
        f"{robot.bytes_per_s / 1000.0:.1f} kB/s" if is_connected else "-",
        format_pose(track.pose),
        f"{track.distance_m:.2f} m",
        format_nearest(is_connected and track.proximity_seen, track.is_free, track.nearest),
        *(format_value(row.values.get(topic.name), topic.unit) for topic in topics),
        make_printable("; ".join(filter(None, notes))),
    ]


def format_value(value: Any, unit: str) -> str:
    """Return the value of a topic that fleet.yaml declares, with its unit."""
    if value is None:
        return "-"
    return make_printable(f"{value:.2f} {unit}" if isinstance(value, float) else f"{value} {unit}").strip()


def format_table(rows: Sequence[RobotRow], width: int, height: int, topics: Sequence[ExtraTopic] = ()) -> List[str]:
    """Return heading and rows in at most height lines of at most width characters."""
    shown = rows if len(rows) < height else rows[: max(0, height - 2)]
    headings = [*HEADINGS[:-1], *(topic.name.upper() for topic in topics), HEADINGS[-1]]
    table = [headings] + [format_cells(row, topics) for row in shown]
    widths = [max(len(cells[column]) for cells in table) for column in range(len(headings))]
    lines = []
    for cells in table:
        padded = [
            cell.rjust(size) if heading in RIGHT_ALIGNED else cell.ljust(size)
            for cell, size, heading in zip(cells, widths, headings)
        ]
        lines.append("  ".join(padded).rstrip()[:width])
    if len(shown) < len(rows):
        lines.append(("... and %d more: make the terminal taller" % (len(rows) - len(shown)))[:width])
    return lines


def format_title(report: RobotArray, now_s: float, silent: Sequence[str] = ()) -> List[str]:
    """Return the lines above the table; silent: names of drivers that do not answer, now_s: s since 1970."""
    title = describe_counts(report)
    if report.stopped:
        title += f", ALL STOPPED {describe_stop_origin(report, now_s)}".rstrip()  # not last: narrow terminals cut
    for driver in silent:
        title += f", driver {driver.strip('/')} does not answer"
    if report.listening:
        title += f", driver listens on {report.listening}"
    gone = describe_gone(report, now_s)
    return [make_printable(title), *([make_printable(gone) + " (d: list them no longer)"] if gone else [])]


def make_row_dict(row: RobotRow) -> Dict[str, Any]:
    """Return one robot for JSON. nearest is null if nothing is in range, which is_free confirms.

    Its range_m is null on contact.
    """
    robot, track = row.robot, row.track
    return {
        "id": robot.id,
        "namespace": robot.namespace,
        "address": robot.address,
        "state": row.state,
        "stop_state": row.stop_state,
        "odom_hz": round(row.odom_hz, 2),
        "packets_per_s": round(robot.packets_per_s, 2),
        "bytes_per_s": round(robot.bytes_per_s, 1),
        "pose": track.pose and {name: finite(value) for name, value in track.pose._asdict().items()},
        "distance_m": finite(track.distance_m),
        "moved": row.moved,
        "nearest": track.nearest and {name: finite(value) for name, value in track.nearest._asdict().items()},
        "is_free": track.is_free,
        "reconnects": robot.reconnects,
        "clock_offset_s": finite(robot.clock_offset),
        "firmware": robot.firmware,
        "last_error": robot.last_error,
        "notes": row.notes._asdict(),
        "values": {
            name: finite(value) if isinstance(value, float) else str(value) for name, value in row.values.items()
        },
    }


def format_json(rows: Sequence[RobotRow], report: RobotArray) -> str:
    """Return the fleet as one line of JSON; times in s since 1970, null where there is none."""
    fleet = {
        "listening": report.listening,
        "stopped": report.stopped,
        "stopped_by": report.stopped_by,
        "stopped_since": report.stopped_since.to_sec() or None,
        "gone": [
            {"id": robot.id, "namespace": robot.namespace, "since": robot.since.to_sec() or None}
            for robot in report.gone
        ],
        "robots": [make_row_dict(row) for row in rows],
    }
    return json.dumps(fleet, allow_nan=False)
