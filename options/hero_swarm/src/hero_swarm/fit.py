"""Program fit: fits the simulator to robots, from recordings to the error file of its option --errors."""

import argparse
import sys
from typing import Dict, Iterator, List, Optional, Sequence, Tuple

import numpy as np

from hero_node.files import write_file
from hero_recording.bags import BagSet, Message, find_robot_topic, read_rows, to_seconds

from .experiments.errors import ExperimentError
from .fitting.recording import PULSES, VELOCITY, Recording
from .fitting.robot_fit import describe_fit, fit_robot

POSES_TOPIC = "/localization/poses"
PLACES, COMMANDS = ("odometry", "ground_truth"), {"velocity_command": VELOCITY, "motor_command": PULSES}

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
        for robot_id in sorted({robot_id for robot_id, _ in tables}):
            commands, odometry = (tables.get((robot_id, kind), []) for kind in ("commands", "odometry"))
            own = tables.get((robot_id, "map")) or tables.get((robot_id, "ground_truth")) or []
            if len(odometry) > 1 and commands and own:
                found.setdefault(robot_id, []).append(_align(robot_id, [commands, odometry, own]))
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

    def is_wanted(topic: str, message_type: str) -> bool:
        found = find_robot_topic(topic, message_type)
        return topic == POSES_TOPIC or (found is not None and found[1] in (*PLACES, *COMMANDS))

    bag.read(is_wanted, receive)
    for (robot_id, kind), rows in sorted(wrong.items()):
        text = "%s: hero_%d: left out %d of %s with stamps outside of the recording, such as %+.0f s from its start"
        print(text % (path, robot_id, len(rows), kind, rows[0][0] - bag.start_s), file=sys.stderr)
    return tables


def _list_rows(message: Message) -> Iterator[Tuple[int, str, Tuple[float, ...]]]:
    """Yield the id of a robot, the kind of its table and the row there of all that a message adds."""
    if message.topic == POSES_TOPIC:
        for robot in message.content.robots:
            if robot.state == robot.TRACKED:
                yield robot.id, "map", (to_seconds(robot.stamp), robot.x, robot.y, robot.yaw)
        return
    for robot_id, kind, (received_s, *values) in read_rows(*message):
        if kind in PLACES:
            yield robot_id, kind, tuple(values[:4])
        else:
            yield robot_id, "commands", (received_s, COMMANDS[kind], *values)


def _align(robot_id: int, tables: Sequence[Rows]) -> Recording:
    """Return a recording, of its tables in order, whose time begins with the odometry."""
    commands, odometry, poses = (np.array(sorted(rows)) for rows in tables)
    steps = np.diff(odometry, axis=0)
    if (np.hypot(steps[:, 1], steps[:, 2]) > MAX_SPEED_M_S * np.maximum(steps[:, 0], 0.02)).any():
        text = "hero_%d: its odometry jumps: it was set, or the robot restarted; record again"
        raise ExperimentError(text % robot_id)
    start_s = odometry[0, 0]
    for table in (commands, odometry, poses):
        table[:, 0] -= start_s
    return Recording(*(table[table[:, 0] >= 0.0] for table in (commands, odometry, poses)))


def main(arguments: Optional[Sequence[str]] = None) -> int:
    """Fit each robot, print what was found, and write the file; return 1 if a robot was left out.

    Raises: ExperimentError if no robot could be fitted: then nothing is written.
    """
    parser = argparse.ArgumentParser(prog="fit", description="Fit the simulator to the robots of recordings.")
    parser.add_argument("bags", nargs="+", metavar="BAG", help="recordings of odometry, commands and poses")
    parser.add_argument("--out", metavar="FILE", default="robots.errors", help="error file (%(default)s)")
    options = parser.parse_args(arguments)
    lines, left_out = (
        ["# slip cannot be told from smaller wheels: it is the usual one, and wheels are fitted with it"],
        0,
    )
    for robot_id, recordings in sorted(read_recordings(options.bags).items()):
        try:
            own = describe_fit(fit_robot(recordings), robot_id)
        except ValueError as error:
            print("hero_%d: left out: %s" % (robot_id, error), file=sys.stderr)
            left_out = 1
            continue
        print("\n".join(own))
        lines += own
    if len(lines) == 1:
        raise ExperimentError(f"no robot could be fitted; {options.out} is as it was")
    write_file(options.out, ("\n".join(lines) + "\n").encode())
    print(f"written: {options.out}")
    return left_out
