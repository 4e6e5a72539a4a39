"""Poses of all robots of a swarm in one frame: see Robot.pose_in(). Pure."""

from collections import defaultdict
from typing import Dict, Optional

from hero_node import Pose

from ..controllers.pose_check import FrozenCheck
from ..values.errors import FrameError, StaleDataError
from .robot_base import BaseRobot


class CommonFrame:
    """One frame for all robots of a swarm.

    Attributes:
        missing: robot's name -> why its pose is not known, or why it cannot be driven, or None.
    """

    def __init__(self, frame: str) -> None:
        """frame: one in which Robot.pose_in() can tell the pose of each robot, such as map."""
        self.frame = frame
        self.missing: Dict[str, Optional[str]] = {}
        self._checks: Dict[str, FrozenCheck] = defaultdict(FrozenCheck)

    def pose_of(self, robot: BaseRobot) -> Optional[Pose]:
        """Return the robot's pose in the frame; None while it is not known, `missing` then says why. Never waits."""
        odometry, missing = robot.fresh_pose(), robot.missing()
        pose = None
        if odometry is None:
            missing = missing or "no odometry comes"
        else:
            try:
                pose = robot.pose_in(self.frame, timeout_s=0.0)
            except (StaleDataError, FrameError) as error:
                missing = str(error)
            else:
                problem = self._checks[robot.name].add(pose, odometry, robot.now_s)
                pose, missing = None if problem else pose, problem or missing
        self.missing[robot.name] = missing
        return pose
