"""Poses of all robots in one frame as arrays: from localize, or the ground truth of the simulator."""

import threading
from functools import partial
from typing import Dict, List, Sequence, Tuple

import numpy as np
import rospy
from nav_msgs.msg import Odometry

from hero_client.ros.localized_poses import MAX_POSITION_SD_M
from hero_client.values.object_sensing import NO_OBJECTS, Things
from hero_msgs.msg import ObjectPoses, RobotPose, RobotPoses
from hero_node.geometry import yaw_of

__all__ = ["SIMULATOR_FRAME", "ObjectSource", "PoseSource"]

SIMULATOR_FRAME = "world"
"""The frame of the simulator's ground truth, /hero_N/ground_truth; all other frames are those of localize."""

MAX_AGE_S = 0.5
"""A robot whose pose is older than this senses nothing, and is stopped."""


class PoseSource:
    """The newest pose of each robot."""

    def __init__(self, robot_ids: Sequence[int], frame: str, poses_topic: str) -> None:
        """Subscribe to the poses of these robots in frame."""
        self._ids = list(robot_ids)
        self._frame = frame
        self._lock = threading.Lock()
        self._newest: Dict[int, Tuple[float, Tuple[float, float, float]]] = {}
        self._subscribers: List[rospy.Subscriber] = []
        if frame == SIMULATOR_FRAME:
            for robot_id in self._ids:
                topic, receive = "/hero_%d/ground_truth" % robot_id, partial(self._receive_truth, robot_id)
                self._subscribers.append(rospy.Subscriber(topic, Odometry, receive, queue_size=1, tcp_nodelay=True))
        else:
            self._subscribers.append(
                rospy.Subscriber(poses_topic, RobotPoses, self._receive_report, queue_size=1, tcp_nodelay=True)
            )

    def _receive_truth(self, robot_id: int, message: Odometry) -> None:
        pose = message.pose.pose
        with self._lock:
            found = (pose.position.x, pose.position.y, yaw_of(pose.orientation))
            self._newest[robot_id] = (message.header.stamp.to_sec(), found)

    def _receive_report(self, report: RobotPoses) -> None:
        if report.header.frame_id != self._frame:
            return
        with self._lock:
            for robot in report.robots:
                if robot.state != RobotPose.UNKNOWN and robot.position_sd <= MAX_POSITION_SD_M:
                    self._newest[robot.id] = (robot.stamp.to_sec(), (robot.x, robot.y, robot.yaw))

    def read(self) -> Tuple[np.ndarray, np.ndarray]:
        """Return the poses (N, 3), NaN for those that are not known or too old, and their ages in s (N,)."""
        poses, ages_s = np.full((len(self._ids), 3), np.nan), np.full(len(self._ids), np.inf)
        now_s = rospy.get_time()
        with self._lock:
            for row, robot_id in enumerate(self._ids):
                stamp_s, pose = self._newest.get(robot_id, (-np.inf, (np.nan, np.nan, np.nan)))
                ages_s[row] = now_s - stamp_s
                if -MAX_AGE_S < ages_s[row] <= MAX_AGE_S:
                    poses[row] = pose
        return poses, ages_s

    def describe_missing(self, poses: np.ndarray) -> str:
        """Return which robots have no pose, and why, for users; empty if all have one."""
        missing = [robot_id for robot_id, pose in zip(self._ids, poses) if not np.isfinite(pose).all()]
        if not missing:
            return ""
        names = ", ".join("hero_%d" % robot_id for robot_id in missing[:8]) + (", ..." if len(missing) > 8 else "")
        source = "the simulator" if self._frame == SIMULATOR_FRAME else "localize"
        return "no pose of %s in the frame %s: does %s run? They are stopped meanwhile" % (names, self._frame, source)


class ObjectSource:
    """The newest poses of objects: from the simulator, or from the tags that track sees on them.

    Attributes:
        are_needed: whether the behavior can do nothing without one.
    """

    def __init__(self, frame: str, topic: str, radius_m: float, are_needed: bool) -> None:
        """Subscribe to the topic; empty: that of the frame's source. radius_m: of the circle around each object."""
        self.are_needed = are_needed
        self._frame, self._radius_m = frame, radius_m
        self._topic = topic or ("/hero_sim/objects" if frame == SIMULATOR_FRAME else "/track/objects")
        self._known: Dict[str, Tuple[float, float, float]] = {}  # replaced as a whole by rospy's thread
        rospy.Subscriber(self._topic, ObjectPoses, self._receive, queue_size=1, tcp_nodelay=True)

    def _receive(self, report: ObjectPoses) -> None:
        if report.header.frame_id == self._frame:
            # One that a picture does not show is where it was: it moves only while it is pushed.
            self._known = {**self._known, **{thing.name: (thing.x, thing.y, thing.yaw) for thing in report.objects}}

    def read(self) -> Things:
        """Return the objects, in the order of their names."""
        known = self._known
        if not known:
            return NO_OBJECTS
        return Things(np.array([[known[name] for name in sorted(known)]]), np.full(len(known), self._radius_m))

    def describe_missing(self) -> str:
        """Return that there are no objects that are needed, for users; empty if there are."""
        if self._known or not self.are_needed:
            return ""
        return "no object on %s in the frame %s: the robots are stopped meanwhile" % (self._topic, self._frame)
