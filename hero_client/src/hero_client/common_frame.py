"""Odometry of several robots -> their poses in one frame, which swarms need to know of each other.

Odometry alone says where a robot is from where it was switched on. The link to a common frame comes from tf
(frame -> hero_N/odom: a tracking system, the simulator, a static transform), or from measured start poses.
"""

import math
from typing import Any, Dict, List, Optional, Sequence

from .control_laws import Pose
from .frame_watch import FrameError, FrameWatch, plain_frame, shift_pose
from .program import ProgramError
from .robot import Robot

DEFAULT_FRAME = "world"


class CommonFrame:
    """One frame for all robots of a swarm."""

    def __init__(self, frame: str, starts: Optional[Dict[int, Pose]] = None) -> None:
        """starts: robot's number -> its pose in frame at its first pose from now on; None: ask tf."""
        self.frame = frame
        self.missing: Dict[str, Optional[str]] = {}
        self._starts = starts
        self._origins: Dict[int, Pose] = {}
        self._watch = FrameWatch()

    def pose_of(self, robot: Robot) -> Optional[Pose]:
        """Return the robot's pose in the frame, None while it is not known; `missing` then says why."""
        pose = robot.fresh_pose()
        self.missing[robot.name] = robot.missing()
        if pose is None:
            return None
        if self._starts is not None:
            if robot.robot_id not in self._origins:
                self._origins[robot.robot_id] = odom_origin(self._starts[robot.robot_id], pose)
            return shift_pose(self._origins[robot.robot_id], pose)
        try:
            origin = self._watch.origin_of(plain_frame(robot.odometry.header.frame_id), self.frame)
        except FrameError as error:
            self.missing[robot.name] = "%s; start something that publishes it, or give ~starts" % error
            return None
        return shift_pose(origin, pose)

    def close(self) -> None:
        """Listen to /tf no more; safe twice."""
        self._watch.close()


def odom_origin(pose: Pose, odom_pose: Pose) -> Pose:
    """Return where the origin of odometry is, for a robot at pose whose odometry says odom_pose."""
    yaw_rad = pose.yaw_rad - odom_pose.yaw_rad
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    return Pose(
        pose.x_m - cos * odom_pose.x_m + sin * odom_pose.y_m,
        pose.y_m - sin * odom_pose.x_m - cos * odom_pose.y_m,
        yaw_rad,
    )


def parse_starts(text: Any, robot_ids: Optional[Sequence[int]]) -> Optional[Dict[int, Pose]]:
    """Return the poses in text such as "0 0 0; 0.3 0 90" (m, degrees), in the order of the ids; None for no text.

    Raises: ProgramError for anything else.
    """
    parts: List[List[str]] = [part.split() for part in str(text).split(";") if part.strip()]
    if not parts:
        return None
    remedy = '"x y heading" for each robot, in m and degrees, apart by ";"'
    if robot_ids is None or len(parts) != len(robot_ids):
        count = "all" if robot_ids is None else str(len(robot_ids))
        raise ProgramError("~starts has %d poses for %s robots; it must hold %s" % (len(parts), count, remedy))
    starts: Dict[int, Pose] = {}
    for robot_id, part in zip(robot_ids, parts):
        try:
            x_m, y_m, heading_deg = (float(word) for word in part)
        except ValueError:
            raise ProgramError("~starts holds %r, but must hold %s" % (" ".join(part), remedy)) from None
        starts[robot_id] = Pose(x_m, y_m, math.radians(heading_deg))
    return starts
