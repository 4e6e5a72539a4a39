"""The hardware of one robot, as its firmware sees it: a row of the world.

Pure: time is the world's, ms.
"""

from typing import List

from .kinematics import Pose, compose, invert
from .world import World


class Body:
    """One robot's wheels, servos and place.

    Attributes:
        odom_origin: where the robot's odom frame truly lies in the world, since its pose was last set. A
            restart changes nothing: the driver goes on where it was.
    """

    def __init__(self, world: World, index: int) -> None:
        """Be the robot at index of world."""
        self.world = world
        self.index = index
        self.odom_origin = self.true_pose

    @property
    def true_pose(self) -> Pose:
        """Where the robot is in the world."""
        x_m, y_m, theta_rad = self.world.poses[self.index].tolist()
        return (x_m, y_m, theta_rad)

    def carry(self, before: Pose) -> None:
        """Be told that somebody carried the robot here from before: its odom frame came with it."""
        self.odom_origin = compose(self.true_pose, compose(invert(before), self.odom_origin))

    def read_wheels(self, time_ms: int) -> List[float]:
        """Return the travel (m) of the left and right wheel at time_ms of the world."""
        return self.world.read_wheels(self.index, time_ms)

    def write_pulses(self, left_us: int, right_us: int) -> None:
        """Give the servos pulses, which they follow until the next ones."""
        self.world.write_pulses(self.index, left_us, right_us)

    def push(self, speed_m_s: float, for_ms: int) -> None:
        """Be pushed forward by hand for so long, whatever the servos do."""
        self.world.push(self.index, speed_m_s, for_ms)

    def release(self) -> None:
        """Take the pulses away: the wheels come to rest."""
        self.world.release(self.index)
