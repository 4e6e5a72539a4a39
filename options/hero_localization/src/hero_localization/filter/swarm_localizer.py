"""Poses of all robots of a swarm in one frame: a filter for each, and reports. Pure.

now_s and stamps are ROS time. now_s is that of this computer; other computers' stamps may be wrong.
"""

import enum
import math
from typing import Dict, Iterable, List, NamedTuple, Optional, Tuple

import numpy as np

from hero_client.controllers import HeadingCheck, is_upside_down
from hero_node import Pose, list_names, measure_distance, transform_pose, wrap_angle

from .odometry_history import JITTER_M, JITTER_RAD
from .pose_filter import Outcome, PoseFilter, is_near
from .pose_hypothesis import StampedPose
from .pose_sources import DISAGREEING_S, NO_OFFSET, PoseSources
from .source_clocks import SourceClocks
from .tag_heights import TagHeights

LOST_S = 1.0
"""A robot whose pose was not measured for this long is lost: its pose follows its odometry alone."""

ANNOUNCED_STEP_M = 0.02
"""A correction that moves a robot by more than this is said."""

WRONG_HEADING_RAD = 0.35
"""A tag that is glued on by eye is right to a tenth of this."""

UNKNOWN_S = 0.5
"""Time before a measured pose whose motion may seem to be missing, while clocks are unknown: they, and the filter."""

SILENT_S = 1.0
"""Odometry comes 29 times a second."""

AHEAD_S = 0.2
"""A measured pose whose stamp is this far ahead of this computer's clock, and of odometry, is not used: until that time
it would count as newer than all others. A simulated clock may go in steps of 0.1 s."""

BACK_S = 0.1
"""A clock that was set back by more makes all stamps older than those before: robots would stay where they are."""

MAX_AHEAD_S = 0.15
"""Time for which poses are extrapolated: speeds change, and a robot that is silent for longer may have stopped."""

LOOK_PERIOD_S = 0.1
"""Time between two looks for robots that are lost: images may come 60 times a second."""

NAMED_S = 30.0
"""A cause is named once while it lasts; after this long without it, again."""

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
    odometry: Pose
    """Pose in the frame hero_N/odom at the time of the estimate."""
    problem: str


class _Robot:
    """One robot, and what was said of it."""

    def __init__(self) -> None:
        self.filter = PoseFilter()
        self.heading = HeadingCheck()
        self.is_lost = False
        self.untrusted_s = -math.inf
        """Stamp of the last image of a camera that moved; -inf if the robot was measured since."""
        self.sources = PoseSources(self.filter)
        self.outliers = 0
        self.jumps = 0
        self.measured_s = -math.inf
        self.clock_offset_s: Optional[float] = None
        """Stamp of the last measured pose less the time at which it came, if it was too old or too new to be used."""
        self.odometry_offset_s = 0.0
        """The same of the last reading of odometry, always."""
        self.heard_s = self.advanced_s = -math.inf
        """Times at which the last reading of odometry came, and the last one that was newer than those before."""


class SwarmLocalizer:
    """Filters of all robots.

    clocks: those of the sources of measured poses; heights: those of the robots' tags, where two cameras see them.
    """

    def __init__(self, is_correcting_clocks: bool = True) -> None:
        self.clocks, self.heights = SourceClocks(is_correcting_clocks), TagHeights()
        self._robots: Dict[int, _Robot] = {}
        self._now_s = self._looked_s = -math.inf
        self._named_s: Dict[str, float] = {}

    def add_robots(self, robot_ids: Iterable[int]) -> None:
        """Expect these robots too."""
        for robot_id in robot_ids:
            self._robots.setdefault(robot_id, _Robot())

    def add_odometry(self, robot_id: int, stamp_s: float, pose: Pose, now_s: float) -> List[str]:
        """Follow a reading of /hero_N/odom; return lines for users."""
        lines = self._follow_clock(now_s)
        robot = self._robots[robot_id]
        if stamp_s > now_s + SILENT_S:
            robot.odometry_offset_s, robot.heard_s = stamp_s - now_s, now_s
            text = "hero_%d: its odometry comes with stamps %.1f s ahead, and is not used: do the clocks agree?"
            return lines + self._name("odometry %d" % robot_id, text % (robot_id, stamp_s - now_s))
        back_s = robot.filter.odometry.newest_s - stamp_s
        if back_s >= 0.0 and now_s > robot.advanced_s + SILENT_S:
            self._robots[robot_id] = robot = _Robot()
            text = "hero_%d: the clock of its driver was set back by %.1f s: it is localized again"
            lines += self._name("driver %d" % robot_id, text % (robot_id, back_s))
        if stamp_s > robot.filter.odometry.newest_s:
            robot.advanced_s = now_s
        robot.odometry_offset_s, robot.heard_s = stamp_s - now_s, now_s
        used_s = robot.filter.used_s
        for measurement, before, outcome in robot.filter.add_odometry(stamp_s, pose):
            lines += self._note(robot_id, measurement, outcome, before, used_s)
            used_s = robot.filter.used_s
        if robot.jumps != robot.filter.odometry.jumps:
            robot.jumps = robot.filter.odometry.jumps
            lines.append("hero_%d: its odometry was set or it restarted; its place in the map stays" % robot_id)
        return lines

    def add_measurement(self, robot_id: int, measurement: StampedPose, now_s: float) -> List[str]:
        """Correct a robot by a measured pose; return lines for users.

        Raises: KeyError for a robot that is not expected. ValueError as PoseFilter.add_measurement().
        """
        lines = self._follow_clock(now_s)
        robot = self._robots[robot_id]
        offset_s = measurement.stamp_s - now_s
        # The robot's driver and the camera may share a clock that is not this computer's.
        if measurement.stamp_s > max(now_s, robot.filter.odometry.newest_s) + AHEAD_S:
            robot.clock_offset_s = offset_s
            text = "poses from %s come with stamps %.1f s ahead, and are not used: do the clocks agree?"
            return lines + self._name(measurement.source, text % (measurement.source, offset_s))
        measurement = self.clocks.correct(robot_id, measurement, robot.filter.odometry, now_s)
        before = robot.filter.pose()
        used_s = robot.filter.used_s
        outcome = robot.filter.add_measurement(measurement)
        if outcome is Outcome.WAITING:
            return lines
        return lines + self._note(robot_id, measurement, outcome, before, used_s)

    def _name(self, key: str, line: str) -> List[str]:
        """Return a line unless one of this key was named, or went on, in the last NAMED_S."""
        named_s, self._named_s[key] = self._named_s.get(key, -math.inf), self._now_s
        return [] if named_s <= self._now_s < named_s + NAMED_S else [line]

    def _note(
        self, robot_id: int, measurement: StampedPose, outcome: Outcome, before: Optional[Pose], used_s: float
    ) -> List[str]:
        """Note what became of a measured pose; return lines for users.

        before, used_s: where the robot was taken to be before it, and the stamp of the last one that was used.
        """
        robot = self._robots[robot_id]
        is_late = outcome is Outcome.TOO_LATE
        offset_s = measurement.stamp_s - self._now_s
        robot.clock_offset_s = offset_s if is_late or offset_s > AHEAD_S else None
        odometry = robot.filter.odometry.find(measurement.stamp_s)
        if odometry is not None and measurement.stamp_s > robot.measured_s:
            robot.heading.add(measurement.pose, odometry.pose)
        if odometry is not None:
            self.heights.add(robot_id, measurement, odometry.pose)
        robot.measured_s = max(robot.measured_s, measurement.stamp_s)
        if is_late:
            return []
        conflict = robot.sources.note(measurement, outcome)
        if outcome is Outcome.OUTLIER or conflict is not None:
            robot.outliers += outcome is Outcome.OUTLIER
            if conflict is None or not conflict.is_lasting or self.heights.describe():
                return []
            return self._name(conflict.key, "hero_%d: %s" % (robot_id, conflict.text))
        robot.outliers = 0
        was_lost, robot.untrusted_s = robot.is_lost, -math.inf
        # What comes late tells where a lost robot was; it would be lost again at once.
        robot.is_lost = was_lost and measurement.stamp_s < self._now_s - LOST_S
        after = robot.filter.pose()
        if outcome is Outcome.FIRST or before is None or after is None:
            return ["hero_%d found at %s" % (robot_id, _describe_pose(measurement.pose))]
        step_m = measure_distance(before, after)
        step_deg = math.degrees(abs(wrap_angle(after.yaw_rad - before.yaw_rad)))
        step = f"{1000.0 * step_m:.0f} mm and {step_deg:.0f} degrees"
        if outcome is Outcome.MOVED:
            earlier = robot.filter.odometry.find(measurement.stamp_s - UNKNOWN_S)
            if odometry is not None and earlier is not None and not self.clocks.is_settled(measurement.node):
                # What a robot drove lately was no hand while it is unknown when it did.
                turned_rad = odometry.turned_rad - earlier.turned_rad + JITTER_RAD
                driven_m = odometry.distance_m - earlier.distance_m + JITTER_M
                if step_m <= driven_m and math.radians(step_deg) <= turned_rad:
                    return []
            return ["hero_%d was moved by hand: pose reset by %s to %s" % (robot_id, step, _describe_pose(after))]
        if robot.is_lost:
            return []
        if was_lost:
            unseen_s = measurement.stamp_s - used_s
            line = "hero_%d found again after %.1f s, %s off its odometry" % (robot_id, unseen_s, step)
            return self._name("found %d" % robot_id, line)
        return ["hero_%d corrected by %s" % (robot_id, step)] if step_m > ANNOUNCED_STEP_M else []

    def list_source_problems(self) -> Dict[str, str]:
        """Return what is wrong with clocks, or cameras' heights of tags, by a name for it."""
        problems = {f"clock of {name}": text for name, text in self.clocks.list_off().items()}
        heights = self.heights.describe()
        return {**problems, "tag heights": heights} if heights else problems

    def distrust(self, stamp_s: float, robot_ids: Iterable[int], now_s: float) -> None:
        """Take robots as lost, without a line, until a pose is used again: the camera that alone sees them moved."""
        if stamp_s > now_s + AHEAD_S:
            return
        for robot_id in robot_ids:
            robot = self._robots.get(robot_id)
            if robot is not None and stamp_s > robot.filter.used_s + DISAGREEING_S:
                robot.untrusted_s = stamp_s

    def find_lost(self, now_s: float) -> List[str]:
        """Notice robots that are not measured any more; return lines for users. Call it some times a second."""
        lines = self._follow_clock(now_s)
        if self._looked_s <= now_s < self._looked_s + LOOK_PERIOD_S:
            return lines
        lost, self._looked_s = [], now_s
        for name, text in self.list_source_problems().items():
            lines += self._name(name, text)
        for robot_id, robot in sorted(self._robots.items()):
            seen_s = max(robot.filter.used_s, robot.untrusted_s)
            if not robot.is_lost and -math.inf < seen_s < now_s - LOST_S:
                robot.is_lost = True
                lost.append("hero_%d" % robot_id)
        if lost:
            text = "its pose follows its odometry" if len(lost) == 1 else "their poses follow their odometry"
            lines += self._name(f"lost {lost}", f"{list_names(lost)} lost: {text}")
        return lines

    def _follow_clock(self, now_s: float) -> List[str]:
        """If time jumps back, as when a recording is played again, begin anew with all robots; return lines."""
        back_s, self._now_s = self._now_s - now_s, now_s
        if back_s <= BACK_S:
            return []
        self._robots = {robot_id: _Robot() for robot_id in self._robots}
        self.clocks.forget_poses()
        return [f"time jumped back by {back_s:.1f} s: all robots are localized again"]

    def list_robots(
        self, now_s: float, is_extrapolating: bool = False, has_problems: bool = True
    ) -> List[LocalizedRobot]:
        """Return what is known of all robots, in the order of their ids.

        is_extrapolating: where they are now, if they drive on as by their newest odometry; at most MAX_AHEAD_S from it.
        has_problems: say what is wrong with each.
        """
        robots = []
        for robot_id, robot in sorted(self._robots.items()):
            state, estimate = self._estimate(robot)
            odometry, problem = robot.filter.odometry.raw_pose, self._find_problem(robot, now_s) if has_problems else ""
            if is_extrapolating and estimate is not None and 0.0 < now_s - estimate.stamp_s <= MAX_AHEAD_S:
                motion = robot.filter.odometry.find_motion(now_s - estimate.stamp_s)
                estimate = estimate._replace(stamp_s=now_s, pose=transform_pose(estimate.pose, motion))
                odometry = transform_pose(odometry, motion)
            robots.append(LocalizedRobot(robot_id, state, estimate, odometry, problem))
        return robots

    @staticmethod
    def _estimate(robot: _Robot) -> Tuple[RobotState, Optional[StampedPose]]:
        estimate, off = robot.filter.estimate(), robot.sources.find_disagreement()
        state = RobotState.TRACKED
        if estimate is None:
            state = RobotState.UNKNOWN
        elif robot.is_lost or robot.untrusted_s > -math.inf or not is_near(NO_OFFSET, off or NO_OFFSET):
            state = RobotState.LOST
        if estimate is not None and off is not None:  # it may be at either place
            estimate = estimate._replace(covariance=estimate.covariance + np.diag(np.square(off)))
        return state, estimate

    @staticmethod
    def _find_problem(robot: _Robot, now_s: float) -> str:
        newest_s = robot.filter.odometry.newest_s
        if newest_s < now_s - SILENT_S:
            if now_s < robot.heard_s + SILENT_S:
                offset = _describe_offset(robot.odometry_offset_s)
                return f"its odometry comes with stamps {offset}: do the clocks agree?"
            if newest_s == -math.inf:
                return "no odometry: is the robot on?"
            return f"no odometry for {now_s - newest_s:.0f} s: is the robot on and in reach?"
        if robot.clock_offset_s is not None:
            return f"measured poses come with stamps {_describe_offset(robot.clock_offset_s)}: do the clocks agree?"
        if robot.measured_s == -math.inf:
            return "its pose was never measured: is its tag in view?"
        if robot.untrusted_s > now_s - LOST_S:
            return "the camera that sees it moved: calibrate_camera arena"
        if robot.is_lost:
            return f"not measured for {now_s - robot.filter.used_s:.0f} s: is its tag occluded or out of view?"
        conflict = robot.sources.find_conflict()
        if conflict is not None:
            return conflict.text
        error_rad = robot.heading.error_rad
        if error_rad is not None and abs(error_rad) > WRONG_HEADING_RAD:
            kind = "upside down" if is_upside_down(error_rad) else "turned"
            text = "its measured heading is %.0f degrees off its direction of travel: is its tag on %s?"
            return text % (math.degrees(error_rad), kind) + " calibrate_camera robots measures it"
        if robot.outliers:
            return "%d measured poses in a row disagree with its odometry" % robot.outliers
        return ""


def _describe_offset(offset_s: float) -> str:
    return f"{abs(offset_s):.1f} s {'ahead' if offset_s > 0.0 else 'old'}"


def _describe_pose(pose: Pose) -> str:
    return f"({pose.x_m:.3f}, {pose.y_m:.3f}) m, {math.degrees(pose.yaw_rad):.0f} degrees"
