"""Poses of robots and objects in one frame as arrays: from localize, or the ground truth of the simulator."""

import time
from functools import partial
from typing import Dict, List, Sequence, Set, Tuple

import numpy as np
import rospy
from nav_msgs.msg import Odometry

from hero_client.ros import share_drivers, share_poses
from hero_client.values import HERO, MODELS, NO_OBJECTS, FrameError, PlacedObjects, StaleDataError
from hero_msgs.msg import ObjectPoses, Robot
from hero_node import Pose, list_names, pose_of

from ..safety import MAX_AGE_S

SIMULATOR_FRAME = "world"
"""The frame of the simulator's ground truth, /hero_N/ground_truth; all other frames are those of localize."""

FIRST_REPORT_S, REPORT_PERIOD_S = 3.0, 5.0

LOOK_PERIOD_S = 1.0
"""Time between two looks for robots that have joined a driver or that localize has found."""


class PoseSource:
    """The newest pose of each robot."""

    def __init__(self, robot_ids: Sequence[int], frame: str) -> None:
        """Subscribe to the poses of these robots in frame."""
        self._ids: List[int] = []
        self._frame = frame
        self._true: Dict[int, Tuple[Pose, float]] = {}
        self._missing: List[str] = []
        self._next_report_s = time.monotonic() + FIRST_REPORT_S
        if frame != SIMULATOR_FRAME:
            share_poses()  # subscribes
        self.add_robots(robot_ids)

    def add_robots(self, robot_ids: Sequence[int]) -> None:
        """Read these robots, too, after those that are read already."""
        self._ids += robot_ids
        for robot_id in robot_ids if self._frame == SIMULATOR_FRAME else ():
            topic, receive = "/hero_%d/ground_truth" % robot_id, partial(self._receive_truth, robot_id)
            rospy.Subscriber(topic, Odometry, receive, queue_size=1, tcp_nodelay=True)

    def _receive_truth(self, robot_id: int, message: Odometry) -> None:
        pose = message.pose.pose
        self._true[robot_id] = pose_of(pose.position, pose.orientation), message.header.stamp.to_sec()

    def read(self) -> Tuple[np.ndarray, np.ndarray]:
        """Return the poses (N, 3), NaN for those that are not known or too old, and their ages in s (N,)."""
        poses, ages_s = np.full((len(self._ids), 3), np.nan), np.full(len(self._ids), np.inf)
        self._missing = []
        for row, robot_id in enumerate(self._ids):
            try:
                poses[row], ages_s[row] = self._find(robot_id)
            except (FrameError, StaleDataError) as error:
                self._missing.append(str(error))
        return poses, ages_s

    def _find(self, robot_id: int) -> Tuple[Pose, float]:
        """Return a robot's pose and its age in s. Raises: FrameError or StaleDataError with why it is not known."""
        name = "hero_%d" % robot_id
        if self._frame == SIMULATOR_FRAME:
            pose, stamp_s = self._true.get(robot_id, (None, -np.inf))
            age_s = rospy.get_time() - stamp_s
        else:
            pose = share_poses().find(robot_id, self._frame, timeout_s=0.0)
            age_s = share_poses().age_s(robot_id)
        if pose is None:
            source = "the simulator" if self._frame == SIMULATOR_FRAME else "localize"
            raise FrameError(f"{name} has no pose in the frame {self._frame}: does {source} run?")
        if not -MAX_AGE_S < age_s <= MAX_AGE_S:
            raise StaleDataError(f"the pose of {name} in the frame {self._frame} is {age_s:.1f} s old")
        return pose, age_s

    def describe_missing(self) -> str:
        """Return why the last read() lacks poses, for users; empty if all are known."""
        more = " (and %d more robots)" % (len(self._missing) - 1) if len(self._missing) > 1 else ""
        return f"{self._missing[0]}{more}" if self._missing else ""

    def warn(self, text: str) -> None:
        """Log that something is missing, every few seconds, and not while all starts at once."""
        if time.monotonic() >= self._next_report_s:
            self._next_report_s = time.monotonic() + REPORT_PERIOD_S
            rospy.logwarn(text)


class ObjectSource:
    """The newest poses of objects: from the simulator, or from the tags that track sees on them.

    Attributes:
        are_needed: whether the behavior can do nothing without one.
    """

    def __init__(self, frame: str, radius_m: float, are_needed: bool) -> None:
        """Subscribe to the topic of the frame's source. radius_m: of the circle around each object."""
        self.are_needed = are_needed
        self._frame, self._radius_m = frame, radius_m
        self._topic = "/hero_sim/objects" if frame == SIMULATOR_FRAME else "/track/objects"
        self._known: Dict[str, Tuple[float, float, float]] = {}  # replaced as a whole by rospy's thread
        rospy.Subscriber(self._topic, ObjectPoses, self._receive, queue_size=1, tcp_nodelay=True)

    def _receive(self, report: ObjectPoses) -> None:
        if report.header.frame_id == self._frame:
            # One that a picture does not show is where it was: it moves only while it is pushed.
            self._known = {**self._known, **{thing.name: (thing.x, thing.y, thing.yaw) for thing in report.objects}}

    def read(self) -> PlacedObjects:
        """Return the objects, in the order of their names."""
        known = self._known
        if not known:
            return NO_OBJECTS
        return PlacedObjects(np.array([[known[name] for name in sorted(known)]]), np.full(len(known), self._radius_m))

    def describe_missing(self) -> str:
        """Return that there are no objects that are needed, for users; empty if there are."""
        if self._known or not self.are_needed:
            return ""
        return f"no object on {self._topic} in the frame {self._frame}"


class OtherRobots:
    """The robots of all drivers, and those that localize knows, but for those that are commanded."""

    def __init__(self, own_ids: Sequence[int], frame: str) -> None:
        """Begin; frame: of their poses, as in PoseSource."""
        self._frame = frame
        self._source = PoseSource([], frame)
        self._known = set(own_ids)
        self._ids: List[int] = []
        self._joined: Set[int] = set()
        self._lost: List[str] = []
        self._next_look_s = 0.0

    def read(self) -> np.ndarray:
        """Return x m, y m and body radius m of those whose poses are known (M, 3)."""
        if time.monotonic() >= self._next_look_s:
            self._next_look_s = time.monotonic() + LOOK_PERIOD_S
            self._look()
        poses, _ = self._source.read()
        is_known = np.isfinite(poses).all(axis=1)
        lost = [robot_id for robot_id, known in zip(self._ids, is_known.tolist()) if not known]
        self._lost = ["hero_%d" % robot_id for robot_id in lost if robot_id in self._joined]
        models = [MODELS.get(share_drivers().find_model("/hero_%d" % robot_id), HERO) for robot_id in self._ids]
        radii_m = np.array([model.body_radius_m for model in models])
        return np.column_stack((poses[:, :2], radii_m))[is_known]

    def _look(self) -> None:
        report = share_drivers().read()
        robots = report.robots if report else []
        self._joined = {robot.id for robot in robots if robot.id >= 0 and robot.state != Robot.REFUSED}
        found = set(self._joined)
        if self._frame != SIMULATOR_FRAME:
            found |= share_poses().ids
        new = sorted(found - self._known)
        self._known.update(new)
        self._ids += new
        self._source.add_robots(new)

    def describe_missing(self) -> str:
        """Return which robots of the drivers are not avoided, for users; empty if all poses are known."""
        text = "not avoided, for want of a pose in the frame %s: %s"
        return text % (self._frame, list_names(self._lost)) if self._lost else ""
