"""What is heard of each robot -> one row per robot: state, rates, pose, way, nearest obstacle.

Pure: knows neither ROS nor a clock; time enters as now_s, any clock that never steps. Units as in
hero_msgs/Robot; frames: REP 105, a pose is that of hero_N/base_link in hero_N/odom.
"""

import math
from collections import deque
from typing import Deque, Dict, List, NamedTuple, Optional, Sequence, Tuple

RATE_WINDOW_S = 3.0
"""Over which a rate is taken: long enough that 5 Hz reads steadily, short enough to see a robot fall silent."""

MOVED_M = 0.05
"""A way that no noise makes: more than half of the robot's body."""

MOVED_RAD = 1.0

MAX_DISTANCE_M = 1e4
"""Whatever a robot sends beyond this is a mistake."""


class Pose(NamedTuple):
    """Where a robot is by its own odometry: m, m, rad."""

    x_m: float
    y_m: float
    yaw_rad: float


class Obstacle(NamedTuple):
    """What a robot's proximity sensors see nearest, from its centre; bearing 0 ahead, positive to the left."""

    range_m: float
    bearing_rad: float


class RobotRow(NamedTuple):
    """All that is shown of one robot."""

    id: int
    namespace: str
    address: str
    state: str
    stop_state: str
    odom_hz: float
    packets_per_s: float
    bytes_per_s: float
    pose: Optional[Pose]
    way_m: float
    turned_rad: float
    proximity_seen: bool
    nearest: Optional[Obstacle]
    reconnects: int
    clock_offset_s: float
    firmware: str
    last_error: str

    @property
    def name(self) -> str:
        """The namespace without slashes, or the address while the robot has not said its name."""
        return self.namespace.strip("/") or self.address

    @property
    def moved(self) -> bool:
        """Whether the robot has driven or turned enough to say so."""
        return self.way_m >= MOVED_M or self.turned_rad >= MOVED_RAD


class RateMeter:
    """Counts what comes and says how often it came, in the last RATE_WINDOW_S."""

    def __init__(self) -> None:
        self._counts: Deque[Tuple[float, int]] = deque()
        self._total = 0

    def count(self, more: int = 1) -> None:
        """More have come."""
        self._total += more

    def rate_hz(self, now_s: float) -> float:
        """Return the rate since about RATE_WINDOW_S ago; to be called more often than that."""
        self._counts.append((now_s, self._total))
        while len(self._counts) > 2 and self._counts[1][0] <= now_s - RATE_WINDOW_S:
            self._counts.popleft()
        (first_s, first), (last_s, last) = self._counts[0], self._counts[-1]
        return (last - first) / (last_s - first_s) if last_s > first_s else 0.0


class RobotTrack:
    """What odometry and proximity of one robot have said so far."""

    def __init__(self) -> None:
        self.odometry = RateMeter()
        self.pose: Optional[Pose] = None
        self.way_m = 0.0
        self.turned_rad = 0.0
        self.proximity_seen = False
        self.nearest: Optional[Obstacle] = None

    def receive_pose(self, pose: Pose) -> None:
        """Take the newest pose and add to the way what lies between it and the one before.

        A pose that is not finite or farther than MAX_DISTANCE_M counts as none.
        """
        if not (abs(pose.x_m) <= MAX_DISTANCE_M and abs(pose.y_m) <= MAX_DISTANCE_M and math.isfinite(pose.yaw_rad)):
            self.pose = None
            return
        if self.pose is not None:
            self.way_m += math.hypot(pose.x_m - self.pose.x_m, pose.y_m - self.pose.y_m)
            self.turned_rad += abs(math.remainder(pose.yaw_rad - self.pose.yaw_rad, math.tau))
        self.pose = pose

    def receive_proximity(
        self, ranges_m: Sequence[float], angle_min_rad: float, increment_rad: float
    ) -> None:
        """Take the newest proximity message; one without finite angles counts as none."""
        self.proximity_seen = math.isfinite(angle_min_rad) and math.isfinite(increment_rad)
        if not self.proximity_seen:
            self.nearest = None
            return
        self.nearest = find_nearest(ranges_m, angle_min_rad, increment_rad)


def finite(value: float) -> Optional[float]:
    """Return the value for JSON, which knows no infinity and no NaN: null."""
    return value if math.isfinite(value) else None


def find_nearest(ranges_m: Sequence[float], angle_min_rad: float, increment_rad: float) -> Optional[Obstacle]:
    """Return the nearest obstacle; None if none is in range. -Inf is nearer than any number (REP 117)."""
    seen = [
        (range_m, index)
        for index, range_m in enumerate(ranges_m)
        if 0.0 <= range_m <= MAX_DISTANCE_M or range_m == -math.inf
    ]
    if not seen:
        return None
    range_m, index = min(seen)
    return Obstacle(range_m, math.remainder(angle_min_rad + index * increment_rad, math.tau))


def yaw_of_quaternion(x: float, y: float, z: float, w: float) -> float:
    """Return the turn about the vertical axis, rad, -pi to pi."""
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def find_missing(rows: Sequence[RobotRow], ids: Sequence[int]) -> Dict[int, str]:
    """Return which of the robots with these ids did not join or did not move, and which of the two it was."""
    by_id = {row.id: row for row in rows if row.namespace}
    missing = {}
    for robot_id in ids:
        row = by_id.get(robot_id)
        if row is None:
            missing[robot_id] = "did not join"
        elif row.state != "READY":
            missing[robot_id] = "is %s%s" % (row.state, ": " + row.last_error if row.last_error else "")
        elif row.pose is None:
            missing[robot_id] = "joined but sent no odometry"
        elif not row.moved:
            missing[robot_id] = "joined but did not move (%.3f m)" % row.way_m
    return missing


def sort_rows(rows: Sequence[RobotRow], order: str) -> List[RobotRow]:
    """Return the rows in an order: id, state, or nearest (obstacle)."""
    if order == "state":
        return sorted(rows, key=lambda row: (row.state == "READY", row.state, row.id))
    if order == "nearest":
        return sorted(rows, key=lambda row: (row.nearest.range_m if row.nearest else math.inf, row.id))
    return sorted(rows, key=lambda row: (row.id < 0, row.id, row.name))
