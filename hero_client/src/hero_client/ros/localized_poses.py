"""Poses from hero_localization's program localize: one subscription for all robots of a program."""

import math
import threading
import time
from functools import lru_cache
from typing import Dict, NamedTuple, Optional

import rospy

from hero_msgs.msg import RobotPose, RobotPoses
from hero_node.errors import NodeError
from hero_node.geometry import Pose
from hero_node.ros.master import ask_master

from ..values.errors import FrameError, StaleDataError
from ..values.readings import FRESH_S, is_plausible

TOPIC = "/localization/poses"

MAX_POSITION_SD_M = 0.05
"""A robot that drives unseen is known less and less well; with more than this it would miss what it avoids."""

POLL_PERIOD_S = 0.02


class _Report(NamedTuple):
    """The newest message, and when it arrived."""

    frame: str
    sent_s: float
    arrived_s: float
    robots: Dict[int, RobotPose]


class LocalizedPoses:
    """The newest poses of all robots. Pure: now_s is any clock that never steps back."""

    def __init__(self) -> None:
        self._newest: Optional[_Report] = None

    @property
    def frame(self) -> Optional[str]:
        """The frame of the poses; None before the first message."""
        return self._newest.frame if self._newest else None

    def receive(self, message: RobotPoses, now_s: float) -> None:
        """Take a message of localize."""
        robots = {robot.id: robot for robot in message.robots}
        self._newest = _Report(message.header.frame_id, message.header.stamp.to_sec(), now_s, robots)

    def find(self, robot_id: int, now_s: float) -> Pose:
        """Return where a robot is, in the frame of the poses.

        Raises: FrameError if it was never measured. StaleDataError if its pose is old, or uncertain.
        """
        report, name = self._newest, "hero_%d" % robot_id
        if report is None:
            raise FrameError("%s has no pose: no message on %s yet, does localize run?" % (name, TOPIC))
        robot = report.robots.get(robot_id)
        if robot is None:
            raise FrameError(
                "%s has no pose in the frame %s: localize does not know it: name it in its ~robots, or let it join a"
                " driver" % (name, report.frame)
            )
        pose = Pose(robot.x, robot.y, robot.yaw)
        if robot.state == RobotPose.UNKNOWN or not is_plausible(pose):
            raise FrameError(
                "%s has no pose in the frame %s: it was never measured: is its tag in view of the camera?"
                % (name, report.frame)
            )
        silent_s = now_s - report.arrived_s
        if silent_s > FRESH_S:
            raise StaleDataError(
                "the pose of %s in the frame %s is old: no message on %s for %.1f s: does localize still run?"
                % (name, report.frame, TOPIC, silent_s)
            )
        age_s = self.age_s(robot_id, now_s)
        if age_s > FRESH_S:
            raise StaleDataError(
                "the pose of %s in the frame %s is %.1f s old, as is its odometry: is the robot on and in reach?"
                % (name, report.frame, age_s)
            )
        if not robot.position_sd <= MAX_POSITION_SD_M:
            raise StaleDataError(
                "the pose of %s in the frame %s is uncertain by %.0f mm: it drove unseen: is its tag occluded or out of"
                " view?" % (name, report.frame, 1e3 * robot.position_sd)
            )
        return pose

    def age_s(self, robot_id: int, now_s: float) -> float:
        """Return how old the pose of a robot is; inf if it has none."""
        report = self._newest
        if report is None or robot_id not in report.robots:
            return math.inf
        # Both stamps are of the clock of localize, which need not agree with that of this machine.
        return now_s - report.arrived_s + report.sent_s - report.robots[robot_id].stamp.to_sec()


class PoseListener:
    """Subscription to the poses of all robots."""

    def __init__(self) -> None:
        self._poses = LocalizedPoses()
        self._lock = threading.Lock()
        self._subscriber = rospy.Subscriber(TOPIC, RobotPoses, self._receive, queue_size=1, tcp_nodelay=True)
        self._is_expected = _is_published(self._subscriber.resolved_name)

    def _receive(self, message: RobotPoses) -> None:
        with self._lock:
            self._poses.receive(message, time.monotonic())

    def find(self, robot_id: int, frame: str, timeout_s: float) -> Optional[Pose]:
        """Return where a robot is in frame; None if localize does not run, or gives poses in another frame.

        A pose that was never there is waited for. Raises: as LocalizedPoses.find().
        """
        deadline_s = time.monotonic() + timeout_s
        while True:
            with self._lock:
                known_frame = self._poses.frame
                if known_frame != frame and (known_frame is not None or not self._is_expected):
                    return None
                try:
                    return self._poses.find(robot_id, time.monotonic())
                except FrameError:
                    if time.monotonic() >= deadline_s or rospy.is_shutdown():
                        raise
            time.sleep(POLL_PERIOD_S)

    def age_s(self, robot_id: int) -> float:
        """Return how old the pose of a robot is; inf if it has none."""
        with self._lock:
            return self._poses.age_s(robot_id, time.monotonic())


def _is_published(topic: str) -> bool:
    """Return whether the ROS master knows a publisher, so that a message is worth waiting for."""
    try:
        return any(name == topic for name, _ in ask_master("getPublishedTopics", ""))
    except NodeError:
        return False


@lru_cache(maxsize=None)
def share_poses() -> PoseListener:
    """Return the listener that all Robot objects of the program share; the first call subscribes."""
    return PoseListener()
