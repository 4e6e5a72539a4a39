"""Interface between a Robot and the robot that it drives: over ROS topics, or stepped in the same process. Pure."""

from typing import List, Optional, Protocol, Tuple

from hero_node import Clock, Pose, Velocity
from hero_node.robot_constants import RobotModel

from .background_motion import BackgroundMotion, Steps
from .sensing import Neighbor

MAP = "map"
"""The frame in which hero_localization gives poses (REP 105)."""


class RobotLink(Protocol):
    """One robot. Names of topics: "odom", "proximity", "encoder", "laser", "neighbors", "distance"."""

    clock: Clock
    """The time in which the robot lives."""

    @property
    def connected(self) -> bool:
        """Return whether something takes the robot's commands."""

    @property
    def model(self) -> RobotModel:
        """The robot's model, as far as is known now; the stock robot's until then."""

    def missing(self) -> Optional[str]:
        """Return why the robot cannot be driven now, as text for users; None if it can."""

    def subscribe(self, topic: str) -> None:
        """Receive a topic from now on, if that was not so before."""

    def age_s(self, topic: str) -> float:
        """Return the seconds since the last message of a topic arrived; inf before the first."""

    def wait_for_next(self, topic: str, timeout_s: float, count: int = 1) -> None:
        """Wait for the count-th message from now on. Raises: StaleDataError after timeout_s."""

    def read_pose(self) -> Pose:
        """Return the pose in the newest odometry, of which there is one; in hero_N/odom."""

    def read_velocity(self) -> Velocity:
        """Return the velocity in the newest odometry, of which there is one."""

    def read_ranges(self) -> List[float]:
        """Return the newest proximity ranges, of which there are some: see Robot.proximity."""

    def read_infrared_counts(self) -> List[float]:
        """Return the newest counts of the infrared sensors, of which there are some: see Robot.infrared_counts."""

    def read_distance(self) -> float:
        """Return the newest distance ahead, of which there is one: see Robot.distance."""

    def read_neighbors(self) -> List[Neighbor]:
        """Return the newest neighbors, of which there is a message. Raises: StaleDataError without a fresh own pose."""

    def find_localized(self, frame: str, timeout_s: float) -> Optional[Pose]:
        """Return where hero_localization says that the robot is; None if that is in another frame, or does not run.

        Raises: FrameError if the robot was not measured within timeout_s. StaleDataError if its pose is old.
        """

    def find_origin(self, frame: str, timeout_s: float) -> Pose:
        """Return the pose of hero_N/odom in another frame. Raises: FrameError if it is not known."""

    def send_velocity(self, linear_m_s: float, angular_rad_s: float) -> None:
        """Send a velocity; a robot that is not there is warned about, unless it is a stop."""

    def send_color(self, rgb: Tuple[float, float, float]) -> None:
        """Send the color of the light, each part 0..1."""

    def set_odometry(self, pose: Pose) -> None:
        """Set the odometry to this pose, in hero_N/odom. Raises: RobotError if it does not answer or refuses."""

    @property
    def is_stopped(self) -> bool:
        """Return whether the robot takes no motion because all robots are stopped, as far as is known now."""

    def describe_stop(self) -> str:
        """Return what has stopped all robots and how to release them, for users."""

    def start(self, steps: Steps) -> BackgroundMotion:
        """Take steps in the background."""

    def log_warning(self, text: str) -> None:
        """Warn users of what ends nothing."""

    def close(self) -> None:
        """Leave the robot; may be called twice."""
