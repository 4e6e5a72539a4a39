"""Rows of the fleet's table: cells of each robot, order, and classification. Pure."""

from typing import Any, Dict, List, Mapping, NamedTuple, Sequence

from hero_client.ros import RobotTrack
from hero_client.values import STOP_STATES, name_state
from hero_msgs.msg import Robot
from hero_node.files import RobotNotes

MOVED_M = 0.05
"""A distance that noise does not make: more than half of the robot's body."""

MOVED_RAD = 1.0


class RobotRow(NamedTuple):
    """One robot: its driver's report, what its topics have shown, and the rate of its odometry."""

    robot: Robot
    track: RobotTrack
    odom_hz: float
    stopped: bool = False  # whether all robots are
    notes: RobotNotes = RobotNotes()
    values: Mapping[str, Any] = {}  # of topics that fleet.yaml declares, by their names

    @property
    def name(self) -> str:
        """The namespace without slashes, or the address until the robot has identified itself."""
        return str(self.robot.namespace.strip("/") or self.robot.address)

    @property
    def state(self) -> str:
        """The state, in the words of all programs."""
        return name_state(self.robot, self.stopped)

    @property
    def stop_state(self) -> str:
        """The progress of a stop; empty without one."""
        return STOP_STATES.get(self.robot.stop_state, str(self.robot.stop_state))

    @property
    def is_heard(self) -> bool:
        """Return whether odometry and a scan have arrived."""
        return self.track.pose is not None and self.track.proximity_seen

    @property
    def moved(self) -> bool:
        """Return whether the robot has driven or turned more than noise could explain."""
        return self.track.distance_m >= MOVED_M or self.track.turned_rad >= MOVED_RAD


def sort_rows(rows: Sequence[RobotRow]) -> List[RobotRow]:
    """Return the rows by the robots' numbers, those without one last."""
    return sorted(rows, key=lambda row: (row.robot.id < 0, row.robot.id, row.name))


def find_missing(rows: Sequence[RobotRow], ids: Sequence[int]) -> Dict[int, str]:
    """Return which of the robots with these ids did not join or move, and why."""
    by_id = {row.robot.id: row for row in rows if row.robot.namespace}
    missing = {}
    for robot_id in ids:
        row = by_id.get(robot_id)
        if row is None:
            missing[robot_id] = "did not join"
        elif row.robot.state != Robot.READY:
            missing[robot_id] = ": ".join(filter(None, ("is " + row.state, row.robot.last_error)))
        elif row.track.pose is None:
            missing[robot_id] = "joined but sent no odometry"
        elif not row.moved:
            missing[robot_id] = f"joined but did not move ({row.track.distance_m:.3f} m)"
    return missing
