"""The sources of one robot's measured poses: whether they agree with its estimate, and with each other. Pure.

A single outlier is a false detection. A source whose poses disagree for longer shows that the estimate may be wrong,
even if another source agrees with it.
"""

import math
from typing import Dict, List, NamedTuple, Optional

from hero_node import Pose, measure_distance, wrap_angle

from .pose_filter import Outcome, PoseFilter
from .pose_hypothesis import StampedPose

DISAGREEING_POSES, DISAGREEING_S = 2, 0.1
"""Outliers of a source in a row, and time since the last of its poses that was used: the robot is not where it is
taken to be. A robot that fewer poses have confirmed is contradicted by as few."""

KEPT_S = 1.0
"""A source that measured the robot this long before another one does not count any more."""

LASTING_S = 8.0
"""A source that disagrees for this long is in another frame; clocks are found in 2 s of motion, and corrected in 4."""

NO_OFFSET = Pose(0.0, 0.0, 0.0)


class Conflict(NamedTuple):
    """Two sources that measure one robot at different places.

    key: their names, in any order the same; is_lasting: it is no matter of clocks, which are corrected by then.
    """

    key: str
    text: str
    is_lasting: bool


class _Source:
    def __init__(self, name: str) -> None:
        self.name = name
        self.outliers = 0
        """In a row."""
        self.since_s = self.used_s = self.measured_s = -math.inf
        """Stamps of the first of these outliers, of the newest pose that was used, and of the newest."""
        self.off = NO_OFFSET
        """By how much the last outlier differs from the estimate."""


class PoseSources:
    """The sources of one robot's measured poses."""

    def __init__(self, pose_filter: PoseFilter) -> None:
        """pose_filter: that of the robot."""
        self._filter = pose_filter
        self._sources: Dict[str, _Source] = {}

    def note(self, measurement: StampedPose, outcome: Outcome) -> Optional[Conflict]:
        """Note what became of a pose of a source; return the conflict that this source has with another one."""
        conflict = self.find_conflict() if outcome is Outcome.MOVED else None
        source = self._sources.get(measurement.source) or _Source(measurement.source)
        source.measured_s = max(source.measured_s, measurement.stamp_s)
        self._sources[source.name] = source
        if len(self._sources) > 1:
            oldest_s = max(other.measured_s for other in self._sources.values()) - KEPT_S
            recent = {name: other for name, other in self._sources.items() if other.measured_s > oldest_s}
            self._sources = {**recent, source.name: source}
        if outcome is not Outcome.OUTLIER:
            for other in [source] if outcome is Outcome.USED else self._sources.values():
                other.outliers = 0  # of all, where the estimate is another one
            source.used_s = max(source.used_s, measurement.stamp_s)
            return conflict
        source.outliers += 1
        if source.outliers == 1:
            source.since_s = measurement.stamp_s
        seen, expected = measurement.pose, self._filter.expect(measurement.stamp_s)
        if expected is not None:
            turn_rad = wrap_angle(seen.yaw_rad - expected.yaw_rad)
            source.off = Pose(seen.x_m - expected.x_m, seen.y_m - expected.y_m, turn_rad)
        return self.find_conflict()

    def _list_disagreeing(self) -> List[_Source]:
        """Return sources whose poses contradict the estimate for a while, or as many as had confirmed it."""
        return [
            source
            for source in self._sources.values()
            if (source.outliers >= DISAGREEING_POSES and source.measured_s - source.used_s >= DISAGREEING_S)
            or source.outliers >= max(1, self._filter.support)
        ]

    def find_disagreement(self) -> Optional[Pose]:
        """Return by how much poses are measured elsewhere, as while it is moved by hand; None if they agree."""
        offs = [source.off for source in self._list_disagreeing()]
        return max(offs, key=lambda off: measure_distance(NO_OFFSET, off)) if offs else None

    def find_conflict(self) -> Optional[Conflict]:
        """Return a source that disagrees while the poses of another one are used; None if there is none."""
        for source in self._list_disagreeing():
            for other in self._sources.values():
                if other.used_s >= source.since_s + DISAGREEING_S:
                    off_mm = 1e3 * measure_distance(NO_OFFSET, source.off)
                    off = f"{off_mm:.0f} mm and {math.degrees(abs(source.off.yaw_rad)):.0f} degrees"
                    text = f"its poses from {source.name} are {off} off those from {other.name}"
                    is_lasting = source.measured_s >= source.since_s + LASTING_S
                    text += ": calibrate both in one frame, or end one" if is_lasting else ""
                    return Conflict(" ".join(sorted((source.name, other.name))), text, is_lasting)
        return None
