"""Topics of stepped robots as bytes, for viewers and bags. Pure.

Names, types and frames are those of driver and simulator; stamps are simulated time.
"""

import math
import struct
from typing import Callable, Dict, List, Sequence, Tuple

import numpy as np

from hero_node import Pose, find_frame
from hero_node.robot_constants import BODY_RADIUS_M, MAX_RIM_RANGE_M, MIN_RIM_RANGE_M, SCAN_TIME_S
from hero_node.ros_messages import encode_header, encode_odometry, encode_transforms, encode_turn_scan, encode_twist

from ..scene import FRAME, START_S, draw_arena, draw_objects, draw_robots, encode_markers
from .robot_rows import RobotRows

MARKERS, OBJECTS, ARENA = "/hero_sim/markers", "/hero_sim/object_markers", "/hero_sim/arena"
MARKER_PERIOD_MS = 100
LATCHED = ("/tf_static", ARENA)

_LIMITS_M = (BODY_RADIUS_M + MIN_RIM_RANGE_M, BODY_RADIUS_M + MAX_RIM_RANGE_M)
_REAR_FIRST = np.roll(np.arange(8), 4)

Receive = Callable[[str, str, bytes, int], None]
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
        self.types: Dict[str, str] = {
            "/tf": "tf2_msgs/TFMessage",
            "/tf_static": "tf2_msgs/TFMessage",
            ARENA: "visualization_msgs/MarkerArray",
            MARKERS: "visualization_msgs/MarkerArray",
            **({OBJECTS: "visualization_msgs/MarkerArray"} if self._has_objects else {}),
        }
        for row, name in enumerate(self._names):
            self.types[f"/{name}/odom"] = self.types[f"/{name}/ground_truth"] = "nav_msgs/Odometry"
            self.types[f"/{name}/proximity"] = "sensor_msgs/LaserScan"
            self.types[f"/{name}/cmd_vel"] = "geometry_msgs/Twist"
            if row in rows.distance_rows:
                self.types[f"/{name}/distance"] = "std_msgs/Float32"
        origins = [
            (FRAME, name + "/odom", find_frame(true_pose, pose))
            for name, true_pose, pose in zip(self._names, self._true_poses, _list_poses(rows.odometry))
        ]
        lasers = [(name + "/base_link", name + "/laser_link", Pose(0.0, 0.0, 0.0)) for name in self._names]
        self._send("/tf_static", encode_transforms(self._stamp, origins + lasers))
        self._send(ARENA, encode_markers(self._time_ns, draw_arena(rows.world.arena)))
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
    def _stamp(self) -> Tuple[int, int]:
        return divmod(self._time_ns, 10**9)

    @property
    def _true_poses(self) -> List[Pose]:
        return _list_poses(self._rows.world.poses[: len(self._names)])

    def _send(self, topic: str, content: bytes) -> None:
        self._pass_on(topic, self.types[topic], content, self._time_ns)

    def _take_cycle(self, rows: np.ndarray) -> None:
        robots, time_ns, stamp, send = self._rows, self._time_ns, self._stamp, self._send
        true_poses, poses = self._true_poses, _list_poses(robots.odometry)
        velocities, true_velocities = robots.velocities.tolist(), robots.world.measure_body_speeds().tolist()
        commands = robots.commands.tolist()
        moved = [row for row in rows.tolist() if row < len(self._names)]
        transforms = []
        for row in moved:
            name = self._names[row]
            odom, base = name + "/odom", name + "/base_link"
            for topic, frame, pose, velocity in (
                ("odom", odom, poses[row], velocities[row]),
                ("ground_truth", FRAME, true_poses[row], true_velocities[row]),
            ):
                send(f"/{name}/{topic}", encode_odometry(frame, base, stamp, pose, velocity))
            transforms.append((odom, base, poses[row]))
            if commands[row] != self._commands[row].tolist():
                self._commands[row] = commands[row]
                send(f"/{name}/cmd_vel", encode_twist(*commands[row]))
        if transforms:
            send("/tf", encode_transforms(stamp, transforms))
        if robots.now_ms >= self._next_markers_ms:
            self._next_markers_ms = robots.now_ms + MARKER_PERIOD_MS
            shapes = draw_robots(robots.world, self._names, robots.lights.tolist())
            send(MARKERS, encode_markers(time_ns, shapes))
            if self._has_objects:
                send(OBJECTS, encode_markers(time_ns, draw_objects(robots.world.list_objects())))

    def _take_scan(self, rows: np.ndarray) -> None:
        ranges_m = self._rows.proximity_m[: len(self._names), _REAR_FIRST]
        ranges_m = np.where(ranges_m == 0.0, -math.inf, ranges_m).tolist()  # as REP 117 has it
        for row in rows.tolist():
            if row < len(self._names):
                name = self._names[row]
                header = encode_header(0, name + "/laser_link", self._stamp)
                self._send(f"/{name}/proximity", encode_turn_scan(header, SCAN_TIME_S, _LIMITS_M, ranges_m[row]))

    def _take_distance(self, rows: np.ndarray) -> None:
        for row in rows.tolist():
            if row < len(self._names):
                distance_m = self._rows.distance_m[row]
                self._send(f"/{self._names[row]}/distance", struct.pack("<f", distance_m))


def _list_poses(poses: np.ndarray) -> List[Pose]:
    return [Pose(*pose) for pose in poses.tolist()]
