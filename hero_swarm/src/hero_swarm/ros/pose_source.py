"""Poses of all robots in one frame as arrays: from localize, or the ground truth of the simulator."""

import threading
from functools import partial
from typing import Dict, List, Sequence, Tuple

import numpy as np
import rospy
from nav_msgs.msg import Odometry

from hero_client.ros.localized_poses import MAX_POSITION_SD_M
from hero_client.values.geometry import yaw_of
from hero_msgs.msg import RobotPose, RobotPoses

__all__ = ["SIMULATOR_FRAME", "PoseSource"]

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
