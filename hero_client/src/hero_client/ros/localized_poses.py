"""Poses from hero_localization's program localize: one subscription for all robots of a program."""

import math
import time
from contextlib import suppress
from functools import lru_cache
from typing import Dict, NamedTuple, Optional, Set

import rospy

from hero_msgs.msg import RobotPose, RobotPoses
from hero_node import NodeError, Pose
from hero_node.ros import ask_master

from ..values.errors import FrameError, StaleDataError
from ..values.readings import FRESH_S, is_plausible

TOPIC = "/localization/poses"

MAX_POSITION_SD_M = 0.05
"""A robot that drives unseen is known less and less well; with more than this it would miss what it avoids."""

POLL_PERIOD_S = 0.02


class PoseReport(NamedTuple):
    """The poses of all robots in one message."""

    frame: str
    sent_s: float
    """By the clock of localize, which need not agree with that of this machine."""
    arrived_s: float
    """By any clock that never steps back, as now_s below."""
    robots: Dict[int, RobotPose]

    def find(self, robot_id: int, now_s: float) -> Pose:
        """Return where a robot is.

        Raises: FrameError if it was never measured. StaleDataError if its pose is old, stamped ahead, or uncertain.
        """
        robot = self.robots.get(robot_id)
        unknown = "hero_%d has no pose in the frame %s: " % (robot_id, self.frame)
        if robot is None:
            raise FrameError(unknown + "localize does not know it: name it in its ~robots, or let it join a driver")
        pose = Pose(robot.x, robot.y, robot.yaw)
        if robot.state == RobotPose.UNKNOWN or not is_plausible(pose):
            raise FrameError(unknown + "it was never measured: is its tag in view of the camera?")
        stale = "the pose of hero_%d in the frame %s is " % (robot_id, self.frame)
        silent_s, age_s = now_s - self.arrived_s, self.age_s(robot_id, now_s)
        if silent_s > FRESH_S:
            raise StaleDataError(stale + f"old: no message on {TOPIC} for {silent_s:.1f} s: does localize still run?")
        if age_s > FRESH_S:
            raise StaleDataError(stale + f"{age_s:.1f} s old, as is its odometry: is the robot on and in reach?")
        if age_s < -FRESH_S:
            raise StaleDataError(
                stale + "stamped %.1f s ahead: do the clocks of all that measures poses agree?" % -age_s
            )
        if not robot.position_sd <= MAX_POSITION_SD_M:
            text = "uncertain by %.0f mm: is its tag occluded or out of view, or is it measured at two places?"
            raise StaleDataError(stale + text % (1e3 * robot.position_sd))
        return pose

    def age_s(self, robot_id: int, now_s: float) -> float:
        """Return how old the pose of a robot is; inf if it has none."""
        robot = self.robots.get(robot_id)
        return math.inf if robot is None else now_s - self.arrived_s + self.sent_s - robot.stamp.to_sec()


class PoseListener:
    """Subscription to the poses of all robots."""

    def __init__(self) -> None:
        """Subscribe; asks the ROS master, which may take seconds."""
        self._report: Optional[PoseReport] = None  # replaced, never changed: read on all threads
        self._subscriber = rospy.Subscriber(TOPIC, RobotPoses, self._receive, queue_size=1, tcp_nodelay=True)
        self._is_expected = False  # whether there is a publisher, so that a message is worth waiting for
        with suppress(NodeError):
            published = ask_master("getPublishedTopics", "")
            self._is_expected = any(name == self._subscriber.resolved_name for name, _ in published)

    def _receive(self, message: RobotPoses) -> None:
        robots = {robot.id: robot for robot in message.robots}
        stamp_s = message.header.stamp.to_sec()
        self._report = PoseReport(message.header.frame_id, stamp_s, time.monotonic(), robots)

    def find(self, robot_id: int, frame: str, timeout_s: float) -> Optional[Pose]:
        """Return where a robot is in frame; None if localize does not run, or gives poses in another frame.

        A pose that was never there is waited for. Raises: as PoseReport.find().
        """
        deadline_s = time.monotonic() + timeout_s
        while True:
            report = self._report
            if report is None and not self._is_expected or report is not None and report.frame != frame:
                return None
            try:
                if report is None:
                    text = "hero_%d has no pose: no message on %s yet, does localize run?"
                    raise FrameError(text % (robot_id, TOPIC))
                return report.find(robot_id, time.monotonic())
            except FrameError:
                if time.monotonic() >= deadline_s or rospy.is_shutdown():
                    raise
            time.sleep(POLL_PERIOD_S)

    @property
    def ids(self) -> Set[int]:
        """Robots that localize names, whether their poses are known or not."""
        report = self._report
        return set(report.robots) if report else set()

    def age_s(self, robot_id: int) -> float:
        """Return how old the pose of a robot is; inf if it has none."""
        report = self._report
        return math.inf if report is None else report.age_s(robot_id, time.monotonic())


@lru_cache(maxsize=None)
def share_poses() -> PoseListener:
    """Return the listener that all Robot objects of the program share; the first call subscribes."""
    return PoseListener()
