"""Reads bags for the fit: odometry, commands and poses of each robot."""

import re
from typing import Any, Dict, List, Sequence, Tuple

import numpy as np
import rosbag

from hero_msgs.msg import RobotPose
from hero_node.geometry import pose_of

from ..experiments.errors import ExperimentError
from ..fitting.recording import NO_SCANS, PULSES, VELOCITY, Recording

POSES_TOPIC = "/localization/poses"

_ROBOT = re.compile(r"/hero_(\d+)/(odom|ground_truth|laser|cmd_motor|cmd_vel|velocity_controller/cmd_vel)$")

MAX_SPEED_M_S = 1.0
"""Faster odometry was set, or its robot started anew."""

Rows = List[Tuple[float, ...]]


def read_recordings(paths: Sequence[str]) -> Dict[int, List[Recording]]:
    """Return what each bag holds of each robot that has odometry, commands and poses, by its id.

    Poses are those of localize; without them, those of the simulator. Raises: ExperimentError.
    """
    found: Dict[int, List[Recording]] = {}
    for path in paths:
        try:
            with rosbag.Bag(path) as bag:
                tables = _read_tables(bag)
        except (OSError, rosbag.ROSBagException) as error:
            raise ExperimentError("%s cannot be read: %s" % (path, error or type(error).__name__)) from error
        ids = sorted({robot_id for robot_id, _ in tables})
        poses = {own: tables.get((own, "map")) or tables.get((own, "ground_truth")) or [] for own in ids}
        for robot_id in ids:
            odometry, commands, scans = (tables.get((robot_id, kind), []) for kind in ("odom", "commands", "laser"))
            if len(odometry) > 1 and commands and poses[robot_id]:
                others = [rows for own, rows in poses.items() if own != robot_id and rows]
                own_tables = [commands, odometry, poses[robot_id], scans, *others]
                found.setdefault(robot_id, []).append(_align(robot_id, own_tables))
    if not found:
        text = "%s: no robot with odometry, commands and poses (of localize, or ground truth) in it"
        raise ExperimentError(text % ", ".join(paths))
    return found


def _read_tables(bag: rosbag.Bag) -> Dict[Tuple[int, str], Rows]:
    tables: Dict[Tuple[int, str], Rows] = {}
    topics = [topic for topic in bag.get_type_and_topic_info().topics if topic == POSES_TOPIC or _ROBOT.match(topic)]
    if not topics:
        return tables  # rosbag would take that for all
    for topic, message, received in bag.read_messages(topics=topics):
        if topic == POSES_TOPIC:
            for robot in message.robots:
                if robot.state == RobotPose.TRACKED:
                    row = (robot.stamp.to_sec(), robot.x, robot.y, robot.yaw)
                    tables.setdefault((robot.id, "map"), []).append(row)
            continue
        match = _ROBOT.match(topic)
        assert match is not None
        kind, row = _read_row(match.group(2), message, received.to_sec())
        tables.setdefault((int(match.group(1)), kind), []).append(row)
    return tables


def _read_row(topic: str, message: Any, received_s: float) -> Tuple[str, Tuple[float, ...]]:
    """Return the table of a message, and its row there."""
    if topic in ("odom", "ground_truth"):
        pose = message.pose.pose
        return topic, (message.header.stamp.to_sec(), *pose_of(pose.position, pose.orientation))
    if topic == "laser":
        # Every other beam is an average of its neighbors.
        return topic, (message.header.stamp.to_sec(), *message.intensities[::2])
    if topic == "cmd_motor":
        return "commands", (received_s, PULSES, message.left_motor_pwm, message.right_motor_pwm)
    return "commands", (received_s, VELOCITY, message.linear.x, message.angular.z)


def _align(robot_id: int, tables: Sequence[Rows]) -> Recording:
    """Return a recording, of its tables in order, whose time begins with the odometry."""
    start_s = min(tables[1])[0]
    commands, odometry, poses, scans, *others = (_shift(rows, start_s) for rows in tables)
    steps = np.diff(odometry, axis=0)
    if (np.hypot(steps[:, 1], steps[:, 2]) > MAX_SPEED_M_S * np.maximum(steps[:, 0], 0.02)).any():
        text = "hero_%d: its odometry jumps: it was set, or the robot started anew; record again"
        raise ExperimentError(text % robot_id)
    return Recording(commands, odometry, poses, scans, tuple(others))


def _shift(rows: Rows, start_s: float) -> np.ndarray:
    table = np.array(sorted(rows)) if rows else NO_SCANS
    shifted = table - np.append(start_s, np.zeros(table.shape[1] - 1))
    return shifted[shifted[:, 0] >= 0.0]
