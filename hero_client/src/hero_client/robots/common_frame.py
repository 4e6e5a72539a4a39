"""Poses of all robots of a swarm in one frame: see Robot.pose_in(), or by measured start poses. Pure."""

from typing import Dict, List, Mapping, Optional, Tuple

from hero_node.clock import Clock
from hero_node.errors import ProgramError

from ..values.errors import FrameError, StaleDataError
from ..values.geometry import Pose, invert_pose, transform_pose
from .robot_base import BaseRobot
from .swarm_base import AnyRobot, BaseSwarm

__all__ = ["CommonFrame"]

POLL_PERIOD_S = 0.1


class CommonFrame:
    """One frame for all robots of a swarm.

    Attributes:
        missing: robot's name -> why its pose is not known, or None.
    """

    def __init__(self, frame: str, starts: Optional[Mapping[int, Tuple[float, float, float]]] = None) -> None:
        """starts: robot's id -> its (x_m, y_m, yaw_rad) in frame at its first odometry from now on.

        None: see Robot.pose_in().
        """
        self.frame = frame
        self.missing: Dict[str, Optional[str]] = {}
        self._starts = {robot_id: Pose(*start) for robot_id, start in (starts or {}).items()}
        self._origins: Dict[int, Pose] = {}

    def pose_of(self, robot: BaseRobot) -> Optional[Pose]:
        """Return the robot's pose in the frame; None while it is not known, `missing` then says why."""
        pose = robot.fresh_pose()
        self.missing[robot.name] = robot.missing()
        if pose is None:
            return None
        if self._starts:
            if robot.robot_id not in self._origins:
                self._origins[robot.robot_id] = transform_pose(self._starts[robot.robot_id], invert_pose(pose))
            return transform_pose(self._origins[robot.robot_id], pose)
        try:
            return robot.pose_in(self.frame, timeout_s=0.0)
        except (StaleDataError, FrameError) as error:
            self.missing[robot.name] = str(error)
            return None

    def wait_for_poses(self, clock: Clock, swarm: BaseSwarm[AnyRobot]) -> List[Pose]:
        """Return the poses of all robots as soon as all are known, and log which are waited for.

        Raises: ProgramError if the program is to end before.
        """
        while clock.pace(POLL_PERIOD_S):
            poses = [pose for pose in map(self.pose_of, swarm) if pose is not None]
            swarm.report_missing(self.missing)
            if len(poses) == len(swarm):
                return poses
        raise ProgramError("ended before all robots were there")
