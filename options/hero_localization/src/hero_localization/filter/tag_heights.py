"""Heights of robots' tags above the floor, by two cameras that see one robot. Pure.

A camera takes a tag that is higher than the camera file says for one that is farther from the point below the camera,
and a lower one for a nearer one. So two cameras see it apart, along the line between them.
"""

import math
from typing import Dict, Tuple

import numpy as np

from hero_node import Pose, find_frame, list_names, transform_pose

from .pose_hypothesis import StampedPose
from .pose_sources import LASTING_S

MAX_STEP_S = 0.2
"""Time between poses from two cameras that are compared."""

KEPT_PAIRS = 60
"""Comparisons that count, the last ones: clocks that are off are corrected meanwhile."""

SURE_SDS = 1.5
"""A height is wrong by more than this many of the standard deviations that the cameras tell, which are 1.7 times what
calibrations of two cameras by six tags each, measured to 0.7 mm, leave."""


class TagHeights:
    """Heights of the tags of all robots.

    cameras_m: x and y of cameras in `map`, and their height above the tags, (3,), by the nodes that poses come from.
    """

    def __init__(self) -> None:
        self.cameras_m: Dict[str, np.ndarray] = {}
        self._last: Dict[int, Tuple[StampedPose, Pose]] = {}
        self._errors: Dict[int, Tuple[int, float, float]] = {}
        """Number of comparisons, by how much the tag is too high (m), and since when by too much (stamp), by robot."""

    def add(self, robot_id: int, measurement: StampedPose, odometry: Pose) -> None:
        """Take a measured pose, and the one by odometry at its time."""
        before, counted = self._last.get(robot_id, (measurement, odometry))
        self._last[robot_id] = measurement, odometry
        if before.source == measurement.source or abs(measurement.stamp_s - before.stamp_s) > MAX_STEP_S:
            return
        cameras_m = [self.cameras_m[pose.node] for pose in (before, measurement) if pose.node in self.cameras_m]
        if before.node == measurement.node or len(cameras_m) < 2:
            return
        place_m, there = measurement.pose[:2], transform_pose(find_frame(before.pose, counted), odometry)
        slopes = [np.subtract(place_m, camera_m[:2]) / camera_m[2] for camera_m in cameras_m]
        across = slopes[0] - slopes[1]
        slope = max(math.hypot(*across), 1e-6)
        pairs, error_m, since_s = self._errors.get(robot_id, (0, 0.0, math.inf))
        pairs = min(pairs + 1, KEPT_PAIRS)
        error_m += (float(np.subtract(there[:2], place_m) @ across) / slope**2 - error_m) / pairs
        limit_m = SURE_SDS * math.sqrt(before.covariance.item(0) + measurement.covariance.item(0)) / slope
        since_s = min(since_s, measurement.stamp_s) if abs(error_m) > limit_m else math.inf
        self._errors[robot_id] = pairs, error_m, since_s

    def describe(self) -> str:
        """Return which robots' tags have been at another height for LASTING_S, and the remedy; empty if none has."""
        wrong_m = {
            "hero_%d" % robot_id: error_m
            for robot_id, (_, error_m, since_s) in sorted(self._errors.items())
            if self._last[robot_id][0].stamp_s >= since_s + LASTING_S
        }
        if not wrong_m:
            return ""
        off_mm = 1e3 * float(np.median(list(wrong_m.values())))
        whose = list_names(list(wrong_m)) if 2 * len(wrong_m) <= len(self._errors) else "robots"
        side = "higher" if off_mm > 0.0 else "lower"
        text = "two cameras see tags of %s %.0f mm %s than tag_height_m: correct it in both camera files"
        return text % (whose, abs(off_mm), side)
