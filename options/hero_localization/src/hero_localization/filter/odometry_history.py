"""The odometry of one robot over the last seconds, without jumps, at any time between two readings. Pure.

A robot that restarts begins again at 0, 0, 0, and a program may set its odometry; neither moves the robot. The history
is continuous.
"""

import math
from typing import NamedTuple, Optional, Tuple

from hero_client.values import StampedHistory, interpolate_pose
from hero_node import Pose, find_frame, invert_pose, measure_distance, transform_pose, wrap_angle

KEPT_S = 2.0
"""Older poses than this come too late to be used: a camera with its driver delays by 0.05 to 0.3 s."""

SPEED_S = 0.1
"""Time over which the present speed is measured: three readings."""

MAX_SPEED_M_S = 0.6
MAX_TURN_RAD_S = 20.0
"""Twice what wheels reach; a faster change is not a motion."""

JITTER_M = 0.002
"""A robot that turns on the spot seems to come and go by ticks of its encoders: that is no distance."""

JITTER_RAD = 0.03
"""The same of one wheel, as a turn: wheels are 0.067 m apart."""

JUMP_MARGIN_M = 0.02
JUMP_MARGIN_RAD = 0.3
"""Readings arrive in bunches with stamps that are a few hundredths of a second off."""

RESTART_S = 1.5
"""A robot that restarts sends nothing for longer; its odometry is then back at 0, 0, 0."""


class Odometry(NamedTuple):
    """Odometry of a robot."""

    pose: Pose
    """In a frame that starts as hero_N/odom and never jumps."""
    distance_m: float
    turned_rad: float
    """Length of the path, and of all turns, since the first reading."""
    heading_rad: float = 0.0
    """Turns to the left less turns to the right since then: not wrapped."""
    unobserved_s: float = 0.0
    """Total time of the jumps since then, in which the robot drove an unknown path."""


class OdometryHistory:
    """Odometry increment of a robot.

    jumps: how often the robot's odometry jumped, by a restart or because a program set it.
    raw_pose: the newest reading itself, in hero_N/odom.
    """

    def __init__(self) -> None:
        self.jumps = 0
        self._readings: StampedHistory[Odometry] = StampedHistory(KEPT_S, _interpolate)
        self._found: Tuple[float, Optional[Odometry]] = (math.nan, None)
        """The last that was asked for: all that a measured pose goes through asks for the same."""
        self.raw_pose = self._offset = Pose(0.0, 0.0, 0.0)
        self._counted = self._offset
        """Up to where the length of the path is counted."""

    @property
    def newest_s(self) -> float:
        """The stamp of the newest reading; -inf before the first."""
        return self._readings.newest_s

    def add(self, stamp_s: float, raw: Pose) -> None:
        """Add a reading of /hero_N/odom; one that is not newer than the last is left out."""
        if stamp_s <= self.newest_s:
            return
        pose = transform_pose(self._offset, raw)
        if self._readings.newest is None:
            self._counted = pose
        last, distance_m, turned_rad, heading_rad, unobserved_s = self._readings.newest or Odometry(pose, 0.0, 0.0)
        step_m, step_rad = measure_distance(last, pose), wrap_angle(pose.yaw_rad - last.yaw_rad)
        elapsed_s = stamp_s - self.newest_s
        is_origin = math.hypot(raw.x_m, raw.y_m) < JITTER_M and abs(raw.yaw_rad) < JITTER_RAD
        limit_s = 0.0 if is_origin and elapsed_s > RESTART_S else elapsed_s
        max_step_m, max_step_rad = MAX_SPEED_M_S * limit_s + JUMP_MARGIN_M, MAX_TURN_RAD_S * limit_s + JUMP_MARGIN_RAD
        if step_m > max_step_m or abs(step_rad) > max_step_rad:
            self.jumps += 1
            unobserved_s += elapsed_s
            self._offset = find_frame(last, raw)
            pose, step_rad = last, 0.0
        counted_m = measure_distance(self._counted, pose)
        if counted_m >= JITTER_M:
            distance_m, self._counted = distance_m + counted_m, pose
        turned_rad += abs(step_rad)
        heading_rad += step_rad
        self.raw_pose, self._found = raw, (math.nan, None)
        self._readings.add(stamp_s, Odometry(pose, distance_m, turned_rad, heading_rad, unobserved_s))

    def find_motion(self, duration_s: float) -> Pose:
        """Return the motion of the next duration_s in the robot's frame, if it drives on as in the last SPEED_S."""
        newest, before = self._readings.newest, self._readings.find(self.newest_s - SPEED_S)
        if newest is None or before is None:
            return Pose(0.0, 0.0, 0.0)
        moved = transform_pose(invert_pose(before.pose), newest.pose)
        share = duration_s / SPEED_S
        # Seen from the middle of the turn, the way is straight ahead or back.
        way_m = share * math.copysign(math.hypot(moved.x_m, moved.y_m), moved.x_m)
        turn_rad = share * moved.yaw_rad
        return Pose(way_m * math.cos(turn_rad / 2.0), way_m * math.sin(turn_rad / 2.0), turn_rad)

    def find(self, stamp_s: float) -> Optional[Odometry]:
        """Return the odometry at stamp_s, interpolated; after the newest reading that one, None before the history."""
        if stamp_s >= self._readings.newest_s:
            return self._readings.newest
        if stamp_s != self._found[0]:
            self._found = stamp_s, self._readings.find(stamp_s)
        return self._found[1]


def _interpolate(start: Odometry, end: Odometry, share: float) -> Odometry:
    sums = [before + share * (after - before) for before, after in zip(start[1:], end[1:])]
    return Odometry(interpolate_pose(start.pose, end.pose, share), *sums)
