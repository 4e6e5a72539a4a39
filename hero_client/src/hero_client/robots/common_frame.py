"""Poses of all robots of a swarm in one frame: see Robot.pose_in(). Pure."""

from collections import defaultdict
from typing import Dict, List, Optional

from hero_node import Clock, Pose, ProgramError

from ..controllers.pose_check import FrozenCheck
from ..values.errors import FrameError, StaleDataError
from .robot_base import BaseRobot
from .swarm_base import AnyRobot, BaseSwarm

POLL_HZ = 10.0


class CommonFrame:
    """One frame for all robots of a swarm.

    Attributes:
        missing: robot's name -> why its pose is not known, or None.
    """

    def __init__(self, frame: str) -> None:
        self.frame = frame
        self.missing: Dict[str, Optional[str]] = {}
        self._checks: Dict[str, FrozenCheck] = defaultdict(FrozenCheck)

    def pose_of(self, robot: BaseRobot) -> Optional[Pose]:
        """Return the robot's pose in the frame; None while it is not known, `missing` then says why."""
        odometry = robot.fresh_pose()
        self.missing[robot.name] = robot.missing()
        if odometry is None:
            return None
        try:
            pose = robot.pose_in(self.frame, timeout_s=0.0)
        except (StaleDataError, FrameError) as error:
            self.missing[robot.name] = str(error)
            return None
        problem = self._checks[robot.name].add(pose, odometry, robot.now_s)
        self.missing[robot.name] = problem or self.missing[robot.name]
        return None if problem else pose

    def wait_for_poses(self, clock: Clock, swarm: BaseSwarm[AnyRobot]) -> List[Pose]:
        """Return the poses of all robots as soon as all are known, and log which are waited for.

        Raises: ProgramError if the program is to end before.
        """
        for _ in clock.rate(POLL_HZ):
            poses = [pose for pose in map(self.pose_of, swarm) if pose is not None]
            swarm.report_missing(self.missing)
            if len(poses) == len(swarm):
                return poses
        raise ProgramError("ended before all robots were there")
