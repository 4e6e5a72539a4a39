"""Poses of all robots of a swarm in one frame: a filter for each, and reports. Pure.

now_s and stamps are ROS time.
"""

import enum
import math
from collections import Counter
from typing import Dict, Iterable, List, NamedTuple, Optional

from hero_node.geometry import Pose, measure_distance, wrap_angle
from hero_node.texts import list_names
from hero_node.token_bucket import TokenBucket

from .heading_check import HeadingCheck, is_upside_down
from .pose_filter import Outcome, PoseFilter
from .pose_hypothesis import StampedPose

LOST_S = 1.0
"""A robot whose pose was not measured for this long is lost: its pose follows its odometry alone."""

DISAGREEING_POSES, DISAGREEING_S = 2, 0.1
"""Outliers in a row, and time since the last pose that was used: the robot is not where odometry has it."""

ANNOUNCED_STEP_M = 0.02
"""A correction that moves a robot by more than this is said."""

WRONG_HEADING_RAD = 0.35
"""A tag that is glued on by eye is right to a tenth of this."""

SILENT_S = 1.0
"""Odometry comes 29 times a second."""

AHEAD_S = 0.2
"""A simulated clock may go in steps of 0.1 s."""

LOSS_LINES, LOSS_PERIOD_S = 4, 10.0
"""Burst and period of log lines on robots lost or found: a busy computer loses all robots at once."""

PUBLISH_RATE_HZ = 25.0
"""Default publish rate of localize."""


class RobotState(enum.IntEnum):
    """Quality of a robot's pose."""

    UNKNOWN = 0
    """Never measured."""
    TRACKED = 1
    LOST = 2
    """Measured before: its pose follows its odometry."""


class LocalizedRobot(NamedTuple):
    """Estimate of one robot."""

    robot_id: int
    state: RobotState
    estimate: Optional[StampedPose]
    odom_origin: Optional[Pose]
    """Of the frame hero_N/odom in map."""
    problem: str
    """Problem as text; empty if there is none."""


class _Robot:
    """One robot, and what was said of it."""

    def __init__(self) -> None:
        self.filter = PoseFilter()
        self.heading = HeadingCheck()
        self.is_lost = False
        self.untrusted_s = -math.inf
        """Stamp of the last image of a camera that moved; -inf if the robot was measured since."""
        self.outliers = 0
        self.jumps = 0
        self.measured_s = -math.inf
        self.late_s: Optional[float] = None
        """Stamp of the last measured pose if it was too old to be used."""

    @property
    def disagrees(self) -> bool:
        """Whether it is measured elsewhere, as while it is moved by hand."""
        return self.outliers >= DISAGREEING_POSES and self.measured_s - self.filter.used_s >= DISAGREEING_S


class SwarmLocalizer:
    """Filters of all robots."""

    def __init__(self) -> None:
        self._robots: Dict[int, _Robot] = {}
        self._now_s = -math.inf
        self._loss_lines = _limit_loss_lines()
        self._summed: Dict[str, int] = Counter()

    def add_robots(self, robot_ids: Iterable[int]) -> None:
        """Expect these robots too."""
        for robot_id in robot_ids:
            self._robots.setdefault(robot_id, _Robot())

    def add_odometry(self, robot_id: int, stamp_s: float, pose: Pose) -> List[str]:
        """Follow a reading of /hero_N/odom; return lines for users."""
        robot = self._robots[robot_id]
        used_s, lines = robot.filter.used_s, []
        for measurement, before, outcome in robot.filter.add_odometry(stamp_s, pose):
            lines += self._note(robot_id, measurement, outcome, before, used_s)
            used_s = robot.filter.used_s
        if robot.jumps != robot.filter.odometry.jumps:
            robot.jumps = robot.filter.odometry.jumps
            lines.append("hero_%d: its odometry was set or it restarted; its place in the map stays" % robot_id)
        return lines

    def add_measurement(self, robot_id: int, measurement: StampedPose) -> List[str]:
        """Correct a robot by a measured pose; return lines for users.

        Raises: KeyError for a robot that is not expected. ValueError as PoseFilter.add_measurement().
        """
        robot = self._robots[robot_id]
        before = robot.filter.pose()
        used_s = robot.filter.used_s
        outcome = robot.filter.add_measurement(measurement)
        return [] if outcome is Outcome.WAITING else self._note(robot_id, measurement, outcome, before, used_s)

    def _note(
        self, robot_id: int, measurement: StampedPose, outcome: Outcome, before: Optional[Pose], used_s: float
    ) -> List[str]:
        """Note what became of a measured pose; return lines for users.

        before, used_s: where the robot was taken to be before it, and the stamp of the last one that was used.
        """
        robot = self._robots[robot_id]
        is_late = outcome in (Outcome.TOO_LATE, Outcome.NO_ODOMETRY)
        robot.late_s = measurement.stamp_s if is_late else None
        odometry = robot.filter.odometry.find(measurement.stamp_s)
        if odometry is not None and measurement.stamp_s > robot.measured_s:
            robot.heading.add(measurement.pose, odometry.pose)
        robot.measured_s = max(robot.measured_s, measurement.stamp_s)
        if is_late or outcome is Outcome.OUTLIER:
            robot.outliers += outcome is Outcome.OUTLIER
            return []
        robot.outliers = 0
        was_lost, robot.untrusted_s = robot.is_lost, -math.inf
        # What comes late tells where a lost robot was; it would be lost again at once.
        robot.is_lost = was_lost and measurement.stamp_s < self._now_s - LOST_S
        after = robot.filter.pose()
        if before is None or after is None:
            return ["hero_%d found at %s" % (robot_id, _describe_pose(measurement.pose))]
        step_m = measure_distance(before, after)
        step_deg = math.degrees(abs(wrap_angle(after.yaw_rad - before.yaw_rad)))
        step = "%.0f mm and %.0f degrees" % (1e3 * step_m, step_deg)
        if outcome is Outcome.MOVED:
            return ["hero_%d was moved by hand: pose reset by %s to %s" % (robot_id, step, _describe_pose(after))]
        if robot.is_lost:
            return []
        if was_lost:
            unseen_s = measurement.stamp_s - used_s
            line = "hero_%d found again after %.1f s, %s off its odometry" % (robot_id, unseen_s, step)
            return self._tell_loss(robot_id, line)
        return ["hero_%d corrected by %s" % (robot_id, step)] if step_m > ANNOUNCED_STEP_M else []

    def distrust(self, stamp_s: float, robot_ids: Iterable[int]) -> None:
        """Take robots as lost, without a line, until a pose is used again: the camera that sees them moved.

        Unless another camera has seen them.
        """
        for robot_id in robot_ids:
            robot = self._robots.get(robot_id)
            if robot is not None and stamp_s > robot.filter.used_s + DISAGREEING_S:
                robot.untrusted_s = stamp_s

    def find_lost(self, now_s: float) -> List[str]:
        """Notice robots that are not measured any more; return lines for users. Call it some times a second.

        If time jumps back, as when a recording is played again, all robots are to be found anew.
        """
        lines = []
        if now_s < self._now_s - LOST_S:
            lines.append("time jumped back by %.1f s: all robots are localized again" % (self._now_s - now_s))
            self._robots = {robot_id: _Robot() for robot_id in self._robots}
            self._loss_lines = _limit_loss_lines()
        self._now_s = now_s
        if self._summed and self._loss_lines.take(1.0, now_s):
            text = "%d more lines on robots lost or found again: %s"
            lines.append(text % (sum(self._summed.values()), list_names(list(self._summed))))
            self._summed.clear()
        for robot_id, robot in sorted(self._robots.items()):
            seen_s = max(robot.filter.used_s, robot.untrusted_s)
            if not robot.is_lost and -math.inf < seen_s < now_s - LOST_S:
                robot.is_lost = True
                lines += self._tell_loss(robot_id, "hero_%d lost: its pose follows its odometry" % robot_id)
        return lines

    def _tell_loss(self, robot_id: int, line: str) -> List[str]:
        """Return a line on a robot that is lost or found; of many, find_lost() tells how many there were."""
        if self._loss_lines.take(1.0, self._now_s):
            return [line]
        self._summed["hero_%d" % robot_id] += 1
        return []

    def list_robots(self, now_s: float) -> List[LocalizedRobot]:
        """Return what is known of all robots, in the order of their ids."""
        return [self._describe(robot_id, robot, now_s) for robot_id, robot in sorted(self._robots.items())]

    def _describe(self, robot_id: int, robot: _Robot, now_s: float) -> LocalizedRobot:
        estimate = robot.filter.estimate()
        state = RobotState.TRACKED
        if estimate is None:
            state = RobotState.UNKNOWN
        elif robot.is_lost or robot.untrusted_s > -math.inf or robot.disagrees:
            state = RobotState.LOST
        problem = self._find_problem(robot, state, now_s)
        origin = None if estimate is None else robot.filter.find_odom_origin(estimate.pose)
        return LocalizedRobot(robot_id, state, estimate, origin, problem)

    @staticmethod
    def _find_problem(robot: _Robot, state: RobotState, now_s: float) -> str:
        newest_s = robot.filter.odometry.newest_s
        if newest_s == -math.inf:
            return "no odometry: is the robot on?"
        if newest_s < now_s - SILENT_S:
            return "no odometry for %.0f s: is the robot on and in reach?" % (now_s - newest_s)
        if robot.measured_s == -math.inf:
            return "its pose was never measured: is its tag in view?"
        if robot.late_s is not None:
            return "measured poses come with stamps %.1f s old: do the clocks agree?" % (now_s - robot.late_s)
        if robot.measured_s > now_s + AHEAD_S:
            return "measured poses come with stamps %.1f s ahead: do the clocks agree?" % (robot.measured_s - now_s)
        if robot.untrusted_s > now_s - LOST_S:
            return "the camera that sees it moved: calibrate_camera arena"
        if robot.is_lost:
            return "not measured for %.0f s: is its tag occluded or out of view?" % (now_s - robot.filter.used_s)
        error_rad = robot.heading.error_rad
        if error_rad is not None and abs(error_rad) > WRONG_HEADING_RAD:
            kind = "upside down" if is_upside_down(error_rad) else "turned"
            text = "its measured heading is %.0f degrees off its direction of travel: is its tag on %s?"
            return text % (math.degrees(error_rad), kind) + " calibrate_camera robots measures it"
        if robot.outliers:
            return "%d measured poses in a row disagree with its odometry" % robot.outliers
        return ""


def _limit_loss_lines() -> TokenBucket:
    return TokenBucket(LOSS_LINES, 1.0 / LOSS_PERIOD_S, 0.0)


def _describe_pose(pose: Pose) -> str:
    return "(%.3f, %.3f) m, %.0f degrees" % (pose.x_m, pose.y_m, math.degrees(pose.yaw_rad))
