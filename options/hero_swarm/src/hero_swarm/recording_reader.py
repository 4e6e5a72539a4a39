"""Reads bags for the fit: odometry, commands and poses of each robot."""

import re
import sys
from typing import Dict, Iterator, List, Sequence, Tuple

import numpy as np

from hero_recording.bags import BagSet, Message, find_robot_topic, read_rows, to_seconds

from .experiments.errors import ExperimentError
from .fitting.recording import NO_SCANS, PULSES, VELOCITY, Recording

POSES_TOPIC = "/localization/poses"
PLACES, COMMANDS = ("odometry", "ground_truth"), {"velocity_command": VELOCITY, "motor_command": PULSES}

_LASER = re.compile(r"/hero_(\d+)/laser")

MAX_SPEED_M_S = 1.0
"""Faster odometry was set, or its robot restarted."""

MAX_CLOCK_ERROR_S = 10.0
"""Stamps that lie farther outside of a recording are wrong: a clock was set, or a message damaged."""

MAX_RECORDING_S = 3600.0
"""A minute tells enough; the fit takes memory and time for all of it."""

Rows = List[Tuple[float, ...]]


def read_recordings(paths: Sequence[str]) -> Dict[int, List[Recording]]:
    """Return what each bag holds of each robot that has odometry, commands and poses, by its id.

    Poses are those of localize; without them, those of the simulator. Raises: ExperimentError, RecordingError.
    """
    found: Dict[int, List[Recording]] = {}
    for path in paths:
        tables = _read_tables(path)
        ids = sorted({robot_id for robot_id, _ in tables})
        poses = {own: tables.get((own, "map")) or tables.get((own, "ground_truth")) or [] for own in ids}
        for robot_id in ids:
            odometry, commands, scans = (tables.get((robot_id, kind), []) for kind in ("odometry", "commands", "laser"))
            if len(odometry) > 1 and commands and poses[robot_id]:
                others = [rows for own, rows in poses.items() if own != robot_id and rows]
                own_tables = [commands, odometry, poses[robot_id], scans, *others]
                found.setdefault(robot_id, []).append(_align(robot_id, own_tables))
    if not found:
        text = "%s: no robot with odometry, commands and poses (of localize, or ground truth) in it"
        raise ExperimentError(text % ", ".join(paths))
    return found


def _read_tables(path: str) -> Dict[Tuple[int, str], Rows]:
    """Return the rows of each robot and kind whose stamps lie within the recording; note others on stderr."""
    tables: Dict[Tuple[int, str], Rows] = {}
    bag = BagSet([path])
    if bag.end_s - bag.start_s > MAX_RECORDING_S:
        text = "%s: it lasts %.0f s, but the fit takes at most %.0f s: record less, or keep the PC's clock as it is"
        raise ExperimentError(text % (path, bag.end_s - bag.start_s, MAX_RECORDING_S))
    wrong: Dict[Tuple[int, str], Rows] = {}

    def receive(message: Message) -> None:
        for robot_id, kind, row in _list_rows(message):
            is_within = bag.start_s - MAX_CLOCK_ERROR_S <= row[0] <= bag.end_s + MAX_CLOCK_ERROR_S
            (tables if is_within else wrong).setdefault((robot_id, kind), []).append(row)

    bag.read(_is_wanted, receive)
    for (robot_id, kind), rows in sorted(wrong.items()):
        text = "%s: hero_%d: left out %d of %s with stamps outside of the recording, such as %+.0f s from its start"
        print(text % (path, robot_id, len(rows), kind, rows[0][0] - bag.start_s), file=sys.stderr)
    return tables


def _is_wanted(topic: str, message_type: str) -> bool:
    found = find_robot_topic(topic, message_type)
    is_listed = found is not None and found[1] in (*PLACES, *COMMANDS)
    return is_listed or topic == POSES_TOPIC or _LASER.fullmatch(topic) is not None


def _list_rows(message: Message) -> Iterator[Tuple[int, str, Tuple[float, ...]]]:
    """Yield the id of a robot, the kind of its table and the row there of all that a message adds."""
    topic, content, laser = message.topic, message.content, _LASER.fullmatch(message.topic)
    if topic == POSES_TOPIC:
        for robot in content.robots:
            if robot.state == robot.TRACKED:
                yield robot.id, "map", (to_seconds(robot.stamp), robot.x, robot.y, robot.yaw)
    elif laser:
        # Every other beam is an average of its neighbors.
        yield int(laser[1]), "laser", (to_seconds(content.header.stamp), *content.intensities[::2])
    else:
        for robot_id, kind, (received_s, *values) in read_rows(*message):
            if kind in PLACES:
                yield robot_id, kind, tuple(values[:4])
            else:
                yield robot_id, "commands", (received_s, COMMANDS[kind], *values)


def _align(robot_id: int, tables: Sequence[Rows]) -> Recording:
    """Return a recording, of its tables in order, whose time begins with the odometry."""
    start_s = min(tables[1])[0]
    commands, odometry, poses, scans, *others = (_shift(rows, start_s) for rows in tables)
    steps = np.diff(odometry, axis=0)
    if (np.hypot(steps[:, 1], steps[:, 2]) > MAX_SPEED_M_S * np.maximum(steps[:, 0], 0.02)).any():
        text = "hero_%d: its odometry jumps: it was set, or the robot restarted; record again"
        raise ExperimentError(text % robot_id)
    return Recording(commands, odometry, poses, scans, tuple(others))


def _shift(rows: Rows, start_s: float) -> np.ndarray:
    table = np.array(sorted(rows)) if rows else NO_SCANS
    shifted = table - np.append(start_s, np.zeros(table.shape[1] - 1))
    return shifted[shifted[:, 0] >= 0.0]
