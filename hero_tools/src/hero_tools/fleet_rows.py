"""What the table of the fleet shows of each robot, and how the robots are ordered and judged. Pure."""

import math
from typing import Dict, List, NamedTuple, Optional, Sequence

from hero_client.geometry import Pose
from hero_client.readings import Obstacle

ORDERS = ("id", "state", "nearest")

MOVED_M = 0.05
"""A distance that noise does not make: more than half of the robot's body."""

MOVED_RAD = 1.0


class RobotRow(NamedTuple):
    """One robot."""

    id: int
    namespace: str
    address: str
    state: str
    stop_state: str
    odom_hz: float
    packets_per_s: float
    bytes_per_s: float
    pose: Optional[Pose]  # by its own odometry, in hero_N/odom
    distance_m: float  # driven since the program was started
    turned_rad: float
    proximity_seen: bool
    nearest: Optional[Obstacle]
    reconnects: int
    clock_offset_s: float
    firmware: str
    last_error: str

    @property
    def name(self) -> str:
        """The namespace without slashes, or the address until the robot has identified itself."""
        return self.namespace.strip("/") or self.address

    @property
    def moved(self) -> bool:
        """Whether the robot has driven or turned more than noise could explain."""
        return self.distance_m >= MOVED_M or self.turned_rad >= MOVED_RAD


def sort_rows(rows: Sequence[RobotRow], order: str) -> List[RobotRow]:
    """Return the rows in one of ORDERS; nearest is by the distance of the nearest obstacle."""
    if order == "state":
        return sorted(rows, key=lambda row: (row.state == "READY", row.state, row.id))
    if order == "nearest":
        return sorted(rows, key=lambda row: (row.nearest.range_m if row.nearest else math.inf, row.id))
    return sorted(rows, key=lambda row: (row.id < 0, row.id, row.name))


def find_missing(rows: Sequence[RobotRow], ids: Sequence[int]) -> Dict[int, str]:
    """Return which of the robots with these ids did not join or move, and why."""
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
            missing[robot_id] = "joined but did not move (%.3f m)" % row.distance_m
    return missing
