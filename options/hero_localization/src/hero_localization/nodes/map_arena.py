"""Program map_arena: occupancy grid of the arena from all robots' poses and proximity sensors.

rosrun hero_localization map_arena
rosrun hero_localization map_arena _bounds_m:="-1.5 -1 1.5 1"
rosservice call /map_arena/save                            writes ~file, which map_server reads
"""

import os
import threading
from contextlib import suppress
from functools import partial
from typing import Any, Dict

import numpy as np
import rospy
import yaml
from geometry_msgs.msg import Point, PoseArray, Quaternion
from geometry_msgs.msg import Pose as PoseMessage
from nav_msgs.msg import MapMetaData
from nav_msgs.msg import OccupancyGrid as MapMessage
from PIL import Image
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Float32
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse

from hero_client import Program, ProgramError, read_parameters
from hero_client.values import front_first, is_plausible
from hero_msgs.msg import RobotPose, RobotPoses
from hero_node import Pose
from hero_node.files import replace_file, write_file
from hero_node.parameters import number, string

from ..mapping.occupancy_grid import OccupancyGrid, SwarmMap

STEP_HZ = 10.0
PUBLISH_STEPS = 10
"""Steps between two publications: one second."""

OCCUPIED, UNKNOWN, FREE = 0, 205, 254
"""Gray of a pixel, as map_saver writes it. Source: wiki.ros.org/map_server."""

OCCUPIED_SHARE, FREE_SHARE = 0.65, 0.196
"""Thresholds between them, as map_saver writes them."""


def save_map(path: str, grid: OccupancyGrid) -> str:
    """Write the map to path, which ends in .yaml, and beside it the image; return the image's path. Raises: OSError."""
    pixels = np.full(grid.log_odds.shape, UNKNOWN, dtype=np.uint8)
    pixels[grid.free] = FREE
    pixels[grid.occupied] = OCCUPIED
    image = os.path.splitext(path)[0] + ".png"
    with replace_file(image) as file:
        Image.fromarray(pixels[::-1]).save(file, "PNG")  # the first row of an image is its upper one
    content = {
        "image": os.path.basename(image),
        "resolution": grid.cell_m,
        "origin": [*grid.origin_m, 0.0],
        "negate": 0,
        "occupied_thresh": OCCUPIED_SHARE,
        "free_thresh": FREE_SHARE,
    }
    write_file(path, yaml.safe_dump(content, sort_keys=False).encode())
    return image


class MapNode:
    """The map, its inputs and outputs."""

    def __init__(self, parameters: Dict[str, Any]) -> None:
        """Begin an empty map. Raises: ProgramError for invalid bounds, or a file that does not end in .yaml."""
        self._grid = _make_grid(parameters["bounds_m"], parameters["cell_m"])
        self._map = SwarmMap(self._grid)
        self._lock = threading.Lock()  # inputs come on threads of rospy
        self._path = os.path.abspath(os.path.expanduser(str(parameters["file"])))
        if not self._path.endswith(".yaml"):
            raise ProgramError(f"~file is {self._path!r}, but must end in .yaml; the image beside it in .png")
        self._frame = ""
        self._steps = 0
        self._scans: Dict[int, rospy.Subscriber] = {}
        self._publisher = rospy.Publisher("/map", MapMessage, queue_size=1, latch=True)
        self._frontiers = rospy.Publisher("~frontiers", PoseArray, queue_size=1, latch=True)
        self._share = rospy.Publisher("~known_share", Float32, queue_size=1, latch=True)
        rospy.Subscriber(parameters["poses_topic"], RobotPoses, self._receive_poses, queue_size=10, tcp_nodelay=True)
        rospy.Service("~save", Trigger, self._save)

    def _receive_poses(self, report: RobotPoses) -> None:
        self._frame = report.header.frame_id
        with self._lock:
            for robot in report.robots:
                pose = Pose(robot.x, robot.y, robot.yaw)
                if robot.state == RobotPose.TRACKED and is_plausible(pose):
                    self._map.add_pose(robot.id, robot.stamp.to_sec(), pose)
        for robot in report.robots:
            if robot.id not in self._scans:
                topic, receive = "/hero_%d/proximity" % robot.id, partial(self._receive_ranges, robot.id)
                self._scans[robot.id] = rospy.Subscriber(topic, LaserScan, receive, queue_size=5, tcp_nodelay=True)

    def _receive_ranges(self, robot_id: int, scan: LaserScan) -> None:
        ranges_m = front_first(scan)
        if ranges_m:
            with self._lock:
                self._map.add_ranges(robot_id, scan.header.stamp.to_sec(), ranges_m)

    def step(self) -> None:
        """Put in what has come, and publish once a second; call it at STEP_HZ."""
        with self._lock:
            self._map.update()
        self._steps += 1
        if self._frame and self._steps % PUBLISH_STEPS == 0:
            self._publish()

    def _publish(self) -> None:
        with self._lock:
            percent = self._grid.to_percent()
            frontiers_m, share = self._grid.find_frontiers(), self._grid.known_share
        stamp = rospy.get_rostime()
        message = MapMessage()
        message.header.stamp, message.header.frame_id = stamp, self._frame
        rows, columns = percent.shape
        origin = PoseMessage(Point(*self._grid.origin_m, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0))
        message.info = MapMetaData(stamp, self._grid.cell_m, columns, rows, origin)
        message.data = percent.ravel().tolist()
        self._publisher.publish(message)
        places = [PoseMessage(Point(*place_m, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0)) for place_m in frontiers_m]
        self._frontiers.publish(PoseArray(message.header, places))
        self._share.publish(Float32(share))

    def _save(self, request: TriggerRequest) -> TriggerResponse:
        del request
        try:
            os.makedirs(os.path.dirname(self._path), exist_ok=True)
            with self._lock:
                image = save_map(self._path, self._grid)
        except OSError as error:
            return TriggerResponse(False, f"{error.filename or self._path} cannot be written: {error.strerror}")
        return TriggerResponse(True, f"{self._path} and {image}")


def _make_grid(bounds: Any, cell_m: float) -> OccupancyGrid:
    with suppress(ValueError):  # no numbers, or no area
        values = np.array([float(word) for word in str(bounds).split()])
        if values.shape == (4,) and np.isfinite(values).all() and np.ptp(values) <= 100.0:
            return OccupancyGrid((values[0], values[1], values[2], values[3]), cell_m)
    raise ProgramError(f'~bounds_m is {bounds!r}, but must be "x_min y_min x_max y_max" in m, up to 100 m wide')


PARAMETERS = {
    "bounds_m": string("-1.1 -1.1 1.1 1.1", "x min, y min, x max, y max"),
    "cell_m": number(0.01, 0.005, 0.1, "m", "side of a cell"),
    "poses_topic": string("/localization/poses", "hero_msgs/RobotPoses of `localize`"),
    "file": string("~/hero_maps/arena.yaml", "written by the service `~save`, with an image, for map_server"),
}


def main() -> None:
    """Map until the program is to end. Raises: ProgramError for a wrong parameter."""
    with Program("map_arena") as program:
        parameters = read_parameters(PARAMETERS)
        node = MapNode(parameters)
        for _ in program.rate(STEP_HZ):
            node.step()
