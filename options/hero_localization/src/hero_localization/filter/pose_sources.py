"""The sources of one robot's measured poses: whether they agree with its estimate, and with each other. Pure.

A single outlier is a false detection. A source whose poses disagree for longer shows that the estimate may be wrong,
even if another source agrees with it.
"""

import math
from typing import Dict, List, NamedTuple, Optional

from hero_node import Pose, measure_distance, wrap_angle

from .pose_hypothesis import StampedPose

DISAGREEING_POSES, DISAGREEING_S = 2, 0.1
"""Outliers of a source in a row, and time since the last of its poses that was used: the robot is not where it is
taken to be. A robot that fewer poses have confirmed is contradicted by as few."""

KEPT_S = 1.0
"""A source that measured the robot this long before another one does not count any more."""

NO_OFFSET = Pose(0.0, 0.0, 0.0)


class Conflict(NamedTuple):
    """Two sources that measure one robot at different places."""

    name: str
    """That of which the poses are outliers."""
    other: str
    """That of which the poses are used."""
    off: Pose
    """By how much they differ."""


class _Source:
    def __init__(self, name: str) -> None:
        self.name = name
        self.outliers = 0
        """In a row."""
        self.since_s = self.used_s = self.measured_s = -math.inf
        """Stamps of the first of these outliers, of the newest pose that was used, and of the newest."""
        self.off = NO_OFFSET
        """By how much the last outlier differs from the estimate."""

    def disagrees(self, support: int) -> bool:
        is_lasting = self.outliers >= DISAGREEING_POSES and self.measured_s - self.used_s >= DISAGREEING_S
        return is_lasting or self.outliers >= max(1, support)


class PoseSources:
    """The sources of one robot's measured poses."""

    def __init__(self) -> None:
        self._sources: Dict[str, _Source] = {}

    def note_outlier(self, measurement: StampedPose, expected: Optional[Pose]) -> None:
        """Take a pose that disagrees with the estimate, which expected the robot elsewhere."""
        source = self._note(measurement)
        source.outliers += 1
        if source.outliers == 1:
            source.since_s = measurement.stamp_s
        if expected is not None:
            seen = measurement.pose
            turn_rad = wrap_angle(seen.yaw_rad - expected.yaw_rad)
            source.off = Pose(seen.x_m - expected.x_m, seen.y_m - expected.y_m, turn_rad)

    def note_used(self, measurement: StampedPose) -> None:
        """Take a pose that corrected the estimate."""
        source = self._note(measurement)
        source.outliers = 0
        source.used_s = max(source.used_s, measurement.stamp_s)

    def begin_anew(self) -> None:
        """Forget all outliers: the estimate is another one."""
        for source in self._sources.values():
            source.outliers = 0

    def _note(self, measurement: StampedPose) -> _Source:
        source = self._sources.setdefault(measurement.source, _Source(measurement.source))
        source.measured_s = max(source.measured_s, measurement.stamp_s)
        newest_s = max(other.measured_s for other in self._sources.values())
        recent = {name: other for name, other in self._sources.items() if other.measured_s > newest_s - KEPT_S}
        self._sources = {**recent, source.name: source}
        return source

    def _list_disagreeing(self, support: int) -> List[_Source]:
        return [source for source in self._sources.values() if source.disagrees(support)]

    def find_disagreement(self, support: int) -> Optional[Pose]:
        """Return by how much measured poses differ from the estimate; None if they agree.

        support: number of measured poses that confirmed the estimate.
        """
        offs = [source.off for source in self._list_disagreeing(support)]
        return max(offs, key=lambda off: measure_distance(NO_OFFSET, off)) if offs else None

    def find_conflict(self, support: int) -> Optional[Conflict]:
        """Return a source that disagrees while the poses of another one are used; None if there is none."""
        for source in self._list_disagreeing(support):
            for other in self._sources.values():
                if other.used_s >= source.since_s + DISAGREEING_S:
                    return Conflict(source.name, other.name, source.off)
        return None


def describe_conflict(conflict: Conflict) -> str:
    """Return the conflict and its remedy as text."""
    off_m, off_deg = measure_distance(NO_OFFSET, conflict.off), math.degrees(abs(conflict.off.yaw_rad))
    text = "its poses from %s are %.0f mm and %.0f degrees off those from %s: calibrate both in one frame, or end one"
    return text % (conflict.name, 1e3 * off_m, off_deg, conflict.other)
