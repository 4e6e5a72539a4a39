"""One robot that is stepped in process: what a program uses of hero_client's Robot, and the ground truth. Pure."""

from typing import Any, Callable, Tuple

from hero_client.robots import BaseRobot
from hero_node import Pose, ProgramError

from .link import StepLink
from .step_clock import StepClock


class StepRobot(BaseRobot):
    """One robot of a StepSwarm; time passes while the program waits, in sleep() or in a motion."""

    _link: StepLink

    def __init__(self, robot_id: int, clock: StepClock, row: int) -> None:
        """Be the robot at row of the clock's robots."""
        super().__init__(robot_id, StepLink(clock, row, robot_id))

    def __getattr__(self, name: str) -> Any:
        if name in ("encoder", "imu", "odometry"):
            text = "%s of %s is a ROS message, which robots in process do not send: see wheel_speeds, pose, velocity"
            raise ProgramError(text % (name, self.name))
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    @property
    def row(self) -> int:
        """Its row in the swarm's arrays: StepSwarm.rows."""
        return self._link.row

    @property
    def true_pose(self) -> Pose:
        """The robot's pose in the frame world."""
        return self._link.true_pose

    def localize_by(self, localize: Callable[[], Pose]) -> None:
        """Use the poses of localize in the frame map instead of ground truth.

        localize: returns a pose, or raises FrameError or StaleDataError as Robot.pose_in() does.
        """
        self._link.localize = localize

    @property
    def light(self) -> Tuple[float, float, float]:
        """The color that the robot shows: red, green, blue, each 0..1."""
        red, green, blue, _ = self._link.clock.rows.lights[self.row].tolist()
        return red, green, blue

    def set_stopped(self, stopped: bool) -> None:
        """Block the robot's motions, as after an emergency stop, or release it."""
        if stopped:
            self._link.send_velocity(0.0, 0.0)  # the driver's shaping repeats it
        self._link.is_stopped = stopped
