"""Topics of one robot -> its track: rate, pose, way, what its proximity sensors see."""

from typing import Any, Sequence

from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

from hero_examples.newest_message import NewestMessage
from hero_msgs.msg import Robot

from .fleet_state import Pose, RobotTrack, yaw_of_quaternion

STATES = {Robot.JOINING: "JOINING", Robot.READY: "READY", Robot.AWAY: "AWAY", Robot.REFUSED: "REFUSED"}
STOP_STATES = {
    Robot.NOT_STOPPED: "",
    Robot.STOPPING: "stopping",
    Robot.AT_REST: "at rest",
    Robot.MOVING: "MOVING",
    Robot.UNCONFIRMED: "unconfirmed",
}
"""As the table shows them beside the state."""


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
            self.track.receive_pose(read_pose(odometry.pose.pose))
        scan = self._proximity.take()
        if scan is not None:
            self.ranges_m = scan.ranges
            self.track.receive_proximity(scan.ranges, scan.angle_min, scan.angle_increment)

    def close(self) -> None:
        """End the subscriptions."""
        self._odometry.close()
        self._proximity.close()


def read_pose(message: Any) -> Pose:
    """Return the pose in the plane of a geometry_msgs/Pose."""
    place, turn = message.position, message.orientation
    return Pose(place.x, place.y, yaw_of_quaternion(turn.x, turn.y, turn.z, turn.w))
