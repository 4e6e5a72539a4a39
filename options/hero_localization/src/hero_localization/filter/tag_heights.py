"""Heights of robots' tags above the floor, by two cameras that see one robot. Pure.

A camera takes a tag that is higher than the camera file says for one that is farther from the point below the camera,
and a lower one for a nearer one. So two cameras see it apart, along the line between them.
"""

import math
from typing import Dict, List, Tuple

import numpy as np

from hero_node import Pose, find_frame, list_names, transform_pose

from .pose_hypothesis import StampedPose

MAX_STEP_S = 0.2
"""Time between poses from two cameras that are compared."""

MIN_SLOPE = 0.2
"""Distance between two cameras, by their height above the tags, from which on they tell heights."""

KEPT_PAIRS = 200
"""Comparisons that count: of the last seconds, as errors of clocks do not last."""

SURE_SDS = 1.5
"""A height is wrong by more than this many of the standard deviations that the cameras tell, which are 1.7 times what
calibrations of two cameras by six tags each, measured to 0.7 mm, leave."""

CONFIRMED_S = 5.0
"""A wrong height is named after this long: by then clocks are corrected."""


class _Height:
    """Error of the height of one robot's tag: m, its limit, and since when that is exceeded (stamp, s)."""

    def __init__(self) -> None:
        self.pairs, self.error_m, self.limit_m, self.since_s = 0, 0.0, math.inf, math.inf


class TagHeights:
    """Heights of the tags of all robots.

    cameras_m: x and y of cameras in `map`, and their height above the tags, (3,), by the nodes that poses come from.
    """

    def __init__(self) -> None:
        self.cameras_m: Dict[str, np.ndarray] = {}
        self._last: Dict[int, Tuple[StampedPose, Pose]] = {}
        self._heights: Dict[int, _Height] = {}

    def restart(self) -> None:
        """Forget all comparisons: stamps were wrong."""
        self._heights.clear()

    def add(self, robot_id: int, measurement: StampedPose, odometry: Pose) -> None:
        """Take a measured pose, and the one by odometry at its time."""
        if len(self.cameras_m) < 2:
            return
        before, counted = self._last.get(robot_id, (measurement, odometry))
        self._last[robot_id] = measurement, odometry
        cameras_m = [self.cameras_m.get(pose.node) for pose in (before, measurement)]
        is_near = abs(measurement.stamp_s - before.stamp_s) <= MAX_STEP_S
        if before.node == measurement.node or cameras_m[0] is None or cameras_m[1] is None or not is_near:
            return
        there = transform_pose(find_frame(before.pose, counted), odometry)
        slopes = [
            np.subtract(measurement.pose[:2], camera_m[:2]) / camera_m[2]
            for camera_m in cameras_m
            if camera_m is not None
        ]
        across = slopes[0] - slopes[1]
        slope = math.hypot(*across)
        if slope < MIN_SLOPE:
            return
        height = self._heights.setdefault(robot_id, _Height())
        height.pairs = min(height.pairs + 1, KEPT_PAIRS)
        error_m = float(np.subtract(there[:2], measurement.pose[:2]) @ across) / slope**2
        height.error_m += (error_m - height.error_m) / height.pairs
        sd_m = math.sqrt(before.covariance.item(0) + measurement.covariance.item(0)) / slope
        height.limit_m = SURE_SDS * sd_m
        is_wrong = abs(height.error_m) > height.limit_m
        height.since_s = min(height.since_s, measurement.stamp_s) if is_wrong else math.inf

    def list_wrong(self) -> Dict[int, float]:
        """Return by how much (m) tags are higher than the camera file says, by robot, where that is wrong."""
        return {
            robot_id: height.error_m
            for robot_id, height in sorted(self._heights.items())
            if self._last[robot_id][0].stamp_s >= height.since_s + CONFIRMED_S
        }

    def describe(self) -> str:
        """Return which heights are wrong, and the remedy; empty if none is."""
        wrong = self.list_wrong()
        if not wrong:
            return ""
        off_m = float(np.median(list(wrong.values())))
        names: List[str] = ["hero_%d" % robot_id for robot_id in wrong]
        whose = list_names(names) if len(wrong) <= len(self._heights) / 2.0 else "robots"
        text = "two cameras see tags of %s %.0f mm %s than tag_height_m: correct it in both camera files"
        return text % (whose, 1e3 * abs(off_m), "higher" if off_m > 0.0 else "lower")
