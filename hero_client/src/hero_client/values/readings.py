"""Reads what robots send (poses, velocities, ranges) and rejects numbers that no robot can mean. Pure.

Messages are only read; their meaning: REP 105 (frames), REP 117 (ranges).
"""

import math
from typing import Any, List, NamedTuple, Optional, Sequence

from hero_node import Pose, pose_of, wrap_angle
from hero_node.robot_constants import BEAMS

FRESH_S = 1.0
"""Older data count as missing. Odometry comes 29 times a second and proximity 5 times, but Wi-Fi makes gaps: in each
recording of real robots the longest one lasted 0.15 to 1.3 s."""

MAX_POSITION_M = 1000.0
"""No robot drives this far; a position or range beyond is invalid."""

NOT_CALIBRATED = "its infrared sensors are not calibrated: `rosrun hero_calibration calibrate`"
"""Why ranges are nan, for users: a stock robot sends them for sensors without constants (RangeSensor.ino)."""


class Obstacle(NamedTuple):
    """The nearest thing that a proximity sensor sees."""

    range_m: float
    """Distance from the robot's center."""
    bearing_rad: float
    """Counter-clockwise from the robot's front, -pi..pi."""

    def __repr__(self) -> str:
        """Return the obstacle to a millimeter and a milliradian."""
        return "Obstacle(range_m=%.3f, bearing_rad=%.3f)" % self


def read_pose(message: Any) -> Optional[Pose]:
    """Return the pose in the plane of a geometry_msgs/Pose; None if it is implausible."""
    pose = pose_of(message.position, message.orientation)
    return pose if is_plausible(pose) else None


def is_plausible(pose: Pose) -> bool:
    """Return whether a pose is finite and within MAX_POSITION_M."""
    return abs(pose.x_m) <= MAX_POSITION_M and abs(pose.y_m) <= MAX_POSITION_M and math.isfinite(pose.yaw_rad)


def front_first(scan: Any) -> List[float]:
    """Return the eight ranges of a sensor_msgs/LaserScan, or none if it has no such ones.

    They go from the front on, with 0.0 for -inf (too close to measure) and NaN for what no range can be.
    """
    are_angles_valid = abs(scan.angle_min) <= math.tau and 0.01 < scan.angle_increment < math.inf
    if len(scan.ranges) != BEAMS or not are_angles_valid:
        return []
    front = int(round(-scan.angle_min / scan.angle_increment))
    ranges = [scan.ranges[(front + index) % BEAMS] for index in range(BEAMS)]
    ranges = [0.0 if range_m == -math.inf else range_m for range_m in ranges]
    return [range_m if 0.0 <= range_m <= MAX_POSITION_M or range_m == math.inf else math.nan for range_m in ranges]


def find_nearest(ranges_m: Sequence[float]) -> Optional[Obstacle]:
    """Return the nearest obstacle in ranges from the front on, counter-clockwise; None if none is in range."""
    seen = [(range_m, index) for index, range_m in enumerate(ranges_m) if 0.0 <= range_m <= MAX_POSITION_M]
    if not seen:
        return None
    range_m, index = min(seen)
    return Obstacle(range_m, wrap_angle(index * math.tau / len(ranges_m)))


def is_blind(ranges_m: Sequence[float]) -> bool:
    """Return whether no sensor tells what is near: neither an obstacle nor free space."""
    return all(map(math.isnan, ranges_m))


def is_free(ranges_m: Sequence[float]) -> bool:
    """Return whether every sensor tells that nothing is in range; False if only one does not know."""
    return len(ranges_m) > 0 and all(range_m == math.inf for range_m in ranges_m)


def finite(value: float) -> Optional[float]:
    """Return the value, or None (null in JSON, which has neither infinity nor NaN) if it is not finite."""
    return value if math.isfinite(value) else None
