"""Checks headings measured from outside: where a robot goes by them when it drives forward by its odometry. Pure."""

import math
from collections import deque
from typing import Deque, Optional, Tuple

from hero_node import Pose, invert_pose, measure_distance, transform_pose, wrap_angle

MIN_DRIVE_M = 0.04
"""Poses are a millimeter off: over this distance, a direction is right to 2 degrees."""

MAX_TURN_RAD = 0.3
"""A drive that bends by more shows no direction."""

MIN_SHARE = 0.7
"""A robot that came less far than this share of what odometry counted was blocked, and shows no direction."""

DRIVES = 3
"""Number of drives that are averaged."""


class HeadingCheck:
    """Compares headings and drives of one robot; errors_rad: by each of the last drives."""

    def __init__(self, drives: int = DRIVES) -> None:
        self.errors_rad: Deque[float] = deque(maxlen=drives)
        self._start: Optional[Tuple[Pose, Pose]] = None

    def add(self, seen: Pose, odometry: Pose) -> None:
        """Take a measured pose, and that by odometry at the same time, each in any frame."""
        if self._start is not None:
            start_seen, start = self._start
            if abs(wrap_angle(odometry.yaw_rad - start.yaw_rad)) <= MAX_TURN_RAD:
                driven_m = measure_distance(start, odometry)
                if driven_m < MIN_DRIVE_M:
                    return
                drive = transform_pose(invert_pose(start), odometry)
                moved = transform_pose(invert_pose(start_seen), seen)
                if math.hypot(moved.x_m, moved.y_m) >= MIN_SHARE * driven_m:
                    # Of a heading that exceeds the true one, the same drive leads to the right.
                    error_rad = math.atan2(drive.y_m, drive.x_m) - math.atan2(moved.y_m, moved.x_m)
                    self.errors_rad.append(wrap_angle(error_rad))
        self._start = seen, odometry

    @property
    def error_rad(self) -> Optional[float]:
        """By how much the headings seen exceed the robot's own; None if it did not drive straight far enough yet."""
        if len(self.errors_rad) < DRIVES:
            return None
        return math.atan2(sum(map(math.sin, self.errors_rad)), sum(map(math.cos, self.errors_rad)))


def is_upside_down(heading_error_rad: float) -> bool:
    """Return whether the tag's print points to the robot's rear."""
    return abs(wrap_angle(heading_error_rad)) > math.radians(135.0)
