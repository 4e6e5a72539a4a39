"""Topics of one robot: rate, pose, distance driven, and what its proximity sensors see.

Numbers of robots are checked here, where they enter: what no robot can mean is shown as unknown.
"""

import math
from typing import Any, Optional, Sequence

from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

from hero_client.newest_message import NewestMessage
from hero_msgs.msg import Robot

from .fleet_state import Pose, RobotTrack, yaw_of_quaternion

FARTHEST_M = 1000.0
"""No robot drives so far; a pose beyond is a mistake."""

MAX_RANGES = 64
"""A robot has eight sensors; a scan with more than this is a mistake."""

STATES = {Robot.JOINING: "JOINING", Robot.READY: "READY", Robot.AWAY: "AWAY", Robot.REFUSED: "REFUSED"}
STOP_STATES = {
    Robot.NOT_STOPPED: "",
    Robot.STOPPING: "stopping",
    Robot.AT_REST: "at rest",
    Robot.MOVING: "MOVING",
    Robot.UNCONFIRMED: "unconfirmed",
}
"""As tables show them."""


class RobotListener:
    """Subscriptions to one robot's odometry and proximity."""

    def __init__(self, namespace: str) -> None:
        self.track = RobotTrack()
        self.ranges_m: Sequence[float] = ()
        self._odometry = NewestMessage(namespace + "/odom", Odometry)
        self._proximity = NewestMessage(namespace + "/proximity", LaserScan)
        self._counted = 0

    def read_newest(self) -> None:
        """Read what came since the last call."""
        count = self._odometry.count
        self.track.odometry.count(count - self._counted)
        self._counted = count
        odometry = self._odometry.take()
        if odometry is not None:
            pose = read_pose(odometry.pose.pose)
            if pose is None:
                self.track.pose = None
            else:
                self.track.receive_pose(pose)
        scan = self._proximity.take()
        if scan is not None:
            self.ranges_m = read_ranges(scan)
            self.track.receive_proximity(self.ranges_m, scan.angle_min, scan.angle_increment)

    def close(self) -> None:
        """End the subscriptions."""
        self._odometry.close()
        self._proximity.close()


def read_pose(message: Any) -> Optional[Pose]:
    """Return the pose in the plane of a geometry_msgs/Pose; None for one that no robot can have."""
    place, turn = message.position, message.orientation
    pose = Pose(place.x, place.y, yaw_of_quaternion(turn.x, turn.y, turn.z, turn.w))
    return pose if is_on_map(pose) else None


def is_on_map(pose: Pose) -> bool:
    """Return whether a pose is finite and not absurdly far away."""
    return abs(pose.x_m) <= FARTHEST_M and abs(pose.y_m) <= FARTHEST_M and math.isfinite(pose.yaw_rad)


def read_ranges(message: Any) -> Sequence[float]:
    """Return the ranges of a sensor_msgs/LaserScan, none if it is no scan of a robot; NaN for what is no distance."""
    angles_are_finite = math.isfinite(message.angle_min) and math.isfinite(message.angle_increment)
    if not angles_are_finite or len(message.ranges) > MAX_RANGES:
        return ()
    return [
        range_m if math.isinf(range_m) or 0.0 <= range_m <= FARTHEST_M else math.nan for range_m in message.ranges
    ]
