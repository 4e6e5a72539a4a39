"""Checks whether poses measured from outside, such as those in map, agree with what the robot's wheels do. Pure.

A robot that is steered by a wrong pose drives anywhere: a tag that is glued on upside down turns its heading by 180
degrees, and a tag that appears twice in the image moves it to and fro. Odometry shows both within centimeters.
"""

import math
from collections import deque
from typing import Deque, Optional, Tuple

from hero_node import Pose, measure_distance, wrap_angle

from .heading_check import HeadingCheck

WRONG_HEADING_RAD = math.pi / 4.0
"""Controllers reach goals with smaller errors; one that slides along a wall (MIN_SHARE) is off by less."""

WRONG_DRIVES = 2
"""Number of drives in a row: a single one may be a correction of the pose."""

JUMP_M = 0.1
"""In one step of 0.1 s a robot drives 0.02 m at most."""

JUMPS, JUMP_WINDOW_S = 3, 10.0
"""Number of jumps within this time: a robot that is moved by hand, or found again, jumps once."""

FROZEN_S = 3.0
FROZEN_M, FROZEN_RAD = 0.1, 1.0
"""A pose that stayed the same for this long, and while odometry counted this much, is not where the robot is."""

SAME_M, SAME_RAD = 0.005, 0.05
"""Poses of a robot at rest differ by less."""

FROZEN = "its wheels turn, but its pose stays the same: is the camera's image frozen, or is the robot held?"


def is_apart(one: Pose, other: Pose, distance_m: float, angle_rad: float) -> bool:
    """Return whether two poses of one frame are further apart than distance_m, or turned by more than angle_rad."""
    return measure_distance(one, other) > distance_m or abs(wrap_angle(one.yaw_rad - other.yaw_rad)) > angle_rad


class FrozenCheck:
    """Detects that the pose of one robot stays the same while its odometry counts."""

    def __init__(self) -> None:
        self._start: Optional[Tuple[Pose, Pose, float]] = None

    def add(self, pose: Pose, odometry: Pose, now_s: float) -> str:
        """Take both poses, each in its own frame, at every step; return FROZEN until the pose changes, else nothing."""
        if self._start is None or is_apart(self._start[0], pose, SAME_M, SAME_RAD):
            self._start = (pose, odometry, now_s)
        _, start_odometry, start_s = self._start
        has_driven = is_apart(start_odometry, odometry, FROZEN_M, FROZEN_RAD)
        return FROZEN if has_driven and now_s - start_s >= FROZEN_S else ""


class PoseCheck:
    """Compares the poses of one robot with its odometry."""

    def __init__(self) -> None:
        self._last: Optional[Tuple[Pose, Pose]] = None
        self._heading = HeadingCheck(WRONG_DRIVES)
        self._jumps_s: Deque[float] = deque(maxlen=JUMPS)

    def add(self, pose: Pose, odometry: Pose, now_s: float) -> str:
        """Take both poses, each in its own frame, at every step; return what is wrong, for users, else nothing."""
        last, self._last = self._last or (pose, odometry), (pose, odometry)
        jump_m = abs(measure_distance(last[0], pose) - measure_distance(last[1], odometry))
        if jump_m > JUMP_M:
            self._heading = HeadingCheck(WRONG_DRIVES)
            self._jumps_s.append(now_s)
            if len(self._jumps_s) == JUMPS and now_s - self._jumps_s[0] <= JUMP_WINDOW_S:
                text = "its pose jumps, the last time by %.2f m: is its tag there twice, or is the robot moved by hand?"
                return text % jump_m
        self._heading.add(pose, odometry)
        errors_rad = self._heading.errors_rad
        if len(errors_rad) < WRONG_DRIVES or min(map(abs, errors_rad)) <= WRONG_HEADING_RAD:
            return ""
        return (
            "the heading of its pose is about %.0f degrees off the direction in which it drives: is its tag on upside"
            " down? `rosrun hero_localization calibrate_camera robots` measures it" % math.degrees(errors_rad[-1])
        )
