"""Topics of stepped robots as bytes, for viewers and bags. Pure.

Names, types and frames are those of driver and simulator; stamps are simulated time.
"""

import math
import struct
from typing import Callable, Dict, List, Sequence

import numpy as np

from hero_driver.robot_constants import BODY_RADIUS_M, MAX_RIM_RANGE_M, MIN_RIM_RANGE_M, SCAN_TIME_S
from hero_node import Pose, find_frame

from ..scene import FRAME, START_S, draw_arena, draw_objects, draw_robots
from .robot_rows import RobotRows
from .ros_messages import (
    FLOAT,
    LASER_SCAN,
    MARKER_ARRAY,
    ODOMETRY,
    TF_MESSAGE,
    TWIST,
    MessageType,
    encode_markers,
    encode_odometry,
    encode_scan,
    encode_transforms,
    encode_twist,
)

MARKERS, OBJECTS, ARENA = "/hero_sim/markers", "/hero_sim/object_markers", "/hero_sim/arena"
MARKER_PERIOD_MS = 100
LATCHED = ("/tf_static", ARENA)

_LIMITS_M = (BODY_RADIUS_M + MIN_RIM_RANGE_M, BODY_RADIUS_M + MAX_RIM_RANGE_M)
_REAR_FIRST = np.roll(np.arange(8), 4)

Receive = Callable[[str, MessageType, bytes, int], None]
"""Takes topic, type, content and time (ns) of a message."""


class StepTopics:
    """The topics of the first world's robots, from the moment at which it is made.

    Attributes:
        types: the type of every topic.
    """

    def __init__(self, rows: RobotRows, robot_ids: Sequence[int], receive: Receive) -> None:
        """Pass what is latched to receive at once, all else when robots' programs would receive it."""
        self._rows = rows
        self._names = ["hero_%d" % robot_id for robot_id in robot_ids]
        self._pass_on = receive
        self._commands = np.zeros((len(self._names), 2))
        self._next_markers_ms = rows.now_ms
        self._has_objects = bool(rows.world.list_objects())
        self.types: Dict[str, MessageType] = {
            "/tf": TF_MESSAGE,
            "/tf_static": TF_MESSAGE,
            ARENA: MARKER_ARRAY,
            MARKERS: MARKER_ARRAY,
            **({OBJECTS: MARKER_ARRAY} if self._has_objects else {}),
        }
        for row, name in enumerate(self._names):
            self.types[f"/{name}/odom"] = self.types[f"/{name}/ground_truth"] = ODOMETRY
            self.types[f"/{name}/proximity"] = LASER_SCAN
            self.types[f"/{name}/cmd_vel"] = TWIST
            if row in rows.distance_rows:
                self.types[f"/{name}/distance"] = FLOAT
        origins = [
            (FRAME, name + "/odom", find_frame(true_pose, pose))
            for name, true_pose, pose in zip(self._names, self._true_poses, _list_poses(rows.odometry))
        ]
        lasers = [(name + "/base_link", name + "/laser_link", Pose(0.0, 0.0, 0.0)) for name in self._names]
        self._send("/tf_static", encode_transforms(self._time_ns, origins + lasers))
        self._send(ARENA, encode_markers(self._time_ns, FRAME, draw_arena(rows.world.arena)))
        rows.on_cycle.append(self._take_cycle)
        rows.on_scan.append(self._take_scan)
        rows.on_distance.append(self._take_distance)

    def close(self) -> None:
        """Pass nothing more."""
        self._rows.on_cycle.remove(self._take_cycle)
        self._rows.on_scan.remove(self._take_scan)
        self._rows.on_distance.remove(self._take_distance)

    @property
    def _time_ns(self) -> int:
        return START_S * 10**9 + self._rows.now_ms * 10**6

    @property
    def _true_poses(self) -> List[Pose]:
        return _list_poses(self._rows.world.poses[: len(self._names)])

    def _send(self, topic: str, content: bytes) -> None:
        self._pass_on(topic, self.types[topic], content, self._time_ns)

    def _take_cycle(self, rows: np.ndarray) -> None:
        robots, time_ns, send = self._rows, self._time_ns, self._send
        true_poses, poses = self._true_poses, _list_poses(robots.odometry)
        velocities, true_velocities = robots.velocities.tolist(), robots.world.measure_body_speeds().tolist()
        commands = robots.commands.tolist()
        moved = [row for row in rows.tolist() if row < len(self._names)]
        transforms = []
        for row in moved:
            name = self._names[row]
            frames = name + "/odom", name + "/base_link"
            send(f"/{name}/odom", encode_odometry(time_ns, frames, poses[row], *velocities[row]))
            truth = encode_odometry(time_ns, (FRAME, frames[1]), true_poses[row], *true_velocities[row])
            send(f"/{name}/ground_truth", truth)
            transforms.append((*frames, poses[row]))
            if commands[row] != self._commands[row].tolist():
                self._commands[row] = commands[row]
                send(f"/{name}/cmd_vel", encode_twist(*commands[row]))
        if transforms:
            send("/tf", encode_transforms(time_ns, transforms))
        if robots.now_ms >= self._next_markers_ms:
            self._next_markers_ms = robots.now_ms + MARKER_PERIOD_MS
            shapes = draw_robots(robots.world, self._names, robots.lights.tolist())
            send(MARKERS, encode_markers(time_ns, FRAME, shapes))
            if self._has_objects:
                send(OBJECTS, encode_markers(time_ns, FRAME, draw_objects(robots.world.list_objects())))

    def _take_scan(self, rows: np.ndarray) -> None:
        ranges_m = self._rows.proximity_m[: len(self._names), _REAR_FIRST]
        ranges_m = np.where(ranges_m == 0.0, -math.inf, ranges_m).tolist()  # as REP 117 has it
        for row in rows.tolist():
            if row < len(self._names):
                name = self._names[row]
                scan = encode_scan(self._time_ns, name + "/laser_link", ranges_m[row], _LIMITS_M, SCAN_TIME_S)
                self._send(f"/{name}/proximity", scan)

    def _take_distance(self, rows: np.ndarray) -> None:
        for row in rows.tolist():
            if row < len(self._names):
                distance_m = self._rows.distance_m[row]
                self._send(f"/{self._names[row]}/distance", struct.pack("<f", distance_m))


def _list_poses(poses: np.ndarray) -> List[Pose]:
    return [Pose(*pose) for pose in poses.tolist()]
