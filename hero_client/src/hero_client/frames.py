"""Poses of robots in a common frame, by tf2 or by measured start poses.

Odometry alone gives the pose relative to where the robot was switched on. The link to a common frame comes from tf
(frame -> hero_N/odom: a tracking system, the simulator, a static transform), or from measured start poses. Works in
the plane: heights and tilts of frames are ignored.
"""

from typing import Any, Dict, List, Mapping, Optional, Tuple

import rospy
import tf2_ros

from .geometry import Pose, invert_pose, transform_pose, yaw_of
from .program import Program, ProgramError
from .robot import Robot
from .swarm import Swarm

__all__ = ["CommonFrame", "FrameError", "FrameListener", "strip_slash"]


POLL_PERIOD_S = 0.1


class FrameError(Exception):
    """There is no transform between two frames now; the text names both."""


class FrameListener:
    """Looks up transforms, and listens to /tf only from the first lookup until close().

    /tf of a swarm carries about 150 transforms per second and robot, which a Python program should not read in vain.
    """

    def __init__(self) -> None:
        self._buffer: Any = None
        self._listener: Any = None

    def close(self) -> None:
        """Unsubscribe from /tf until the next lookup; safe twice."""
        if self._listener is not None:
            self._listener.unregister()
            self._buffer = self._listener = None

    def origin_of(self, frame: str, within: str) -> Pose:
        """Return the newest pose of the frame's origin in the frame within.

        Raises: FrameError while tf does not connect the two; after the first lookup that takes a moment.
        """
        if self._listener is None:
            self._buffer = tf2_ros.Buffer(debug=False)
            self._listener = tf2_ros.TransformListener(self._buffer, queue_size=100, tcp_nodelay=True)
        try:
            found = self._buffer.lookup_transform(within, frame, rospy.Time(0)).transform
        except tf2_ros.TransformException as error:
            raise FrameError("no transform from %s to %s: %s" % (frame, within, error)) from None
        return Pose(found.translation.x, found.translation.y, yaw_of(found.rotation))


def strip_slash(frame: str) -> str:
    """Return the frame's name without the leading slash of tf's first version."""
    return frame.lstrip("/")


class CommonFrame:
    """One frame for all robots of a swarm.

    Attributes:
        missing: robot's name -> why its pose is not known, or None.
    """

    def __init__(self, frame: str, starts: Optional[Mapping[int, Tuple[float, float, float]]] = None) -> None:
        """starts: robot's id -> its (x_m, y_m, yaw_rad) in frame at its first odometry from now on; none: use tf."""
        self.frame = frame
        self.missing: Dict[str, Optional[str]] = {}
        self._starts = {robot_id: Pose(*start) for robot_id, start in (starts or {}).items()}
        self._origins: Dict[int, Pose] = {}
        self._listener = FrameListener()

    def pose_of(self, robot: Robot) -> Optional[Pose]:
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
            origin = self._listener.origin_of(strip_slash(robot.odometry.header.frame_id), self.frame)
        except FrameError as error:
            self.missing[robot.name] = "%s; start something that publishes it, or give ~starts" % error
            return None
        return transform_pose(origin, pose)

    def wait_for_poses(self, program: Program, swarm: Swarm) -> List[Pose]:
        """Return the poses of all robots as soon as all are known, and log which are waited for.

        Raises: ProgramError if the program is to end before.
        """
        while program.pace(POLL_PERIOD_S):
            poses = [pose for pose in map(self.pose_of, swarm) if pose is not None]
            swarm.report_missing(self.missing)
            if len(poses) == len(swarm):
                return poses
        raise ProgramError("ended before all robots were there")

    def close(self) -> None:
        """Unsubscribe from /tf; safe twice."""
        self._listener.close()
