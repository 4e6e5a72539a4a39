"""History of a value, interpolated between stamps. Pure."""

import bisect
import math
from typing import Callable, Generic, List, Optional, TypeVar

from hero_node import Pose, wrap_angle

T = TypeVar("T")


class StampedHistory(Generic[T]):
    """Values by their stamps.

    Attributes:
        newest: the newest value; None before the first.
        newest_s: its stamp; -inf before the first.
    """

    def __init__(self, kept_s: float, interpolate: Callable[[T, T, float], T]) -> None:
        """Keep values for kept_s; interpolate: returns the value at a share (0..1) of the way between two."""
        self.newest: Optional[T] = None
        self.newest_s = -math.inf
        self._kept_s = kept_s
        self._interpolate = interpolate
        self._stamps_s: List[float] = []
        self._values: List[T] = []

    def add(self, stamp_s: float, value: T) -> None:
        """Add a value; one that is not newer than the last is left out.

        One that is older than all that is kept begins the history anew: time goes back when a recording is replayed.
        """
        if stamp_s < self.newest_s - self._kept_s:
            self._stamps_s.clear()
            self._values.clear()
        elif stamp_s <= self.newest_s:
            return
        self.newest_s, self.newest = stamp_s, value
        self._stamps_s.append(stamp_s)
        self._values.append(value)
        outdated = bisect.bisect_left(self._stamps_s, stamp_s - self._kept_s)
        del self._stamps_s[:outdated], self._values[:outdated]

    def find(self, stamp_s: float) -> Optional[T]:
        """Return the value at stamp_s, interpolated between two; None before the first and after the newest."""
        after = bisect.bisect_left(self._stamps_s, stamp_s)
        if after == len(self._stamps_s):
            return None
        if self._stamps_s[after] == stamp_s:
            return self._values[after]
        if after == 0:
            return None
        start_s, end_s = self._stamps_s[after - 1 : after + 1]
        share = (stamp_s - start_s) / (end_s - start_s)
        return self._interpolate(self._values[after - 1], self._values[after], share)


def interpolate_pose(start: Pose, end: Pose, share: float) -> Pose:
    """Return the pose at this share of the way from start to end, turned the shorter way."""
    return Pose(
        start.x_m + share * (end.x_m - start.x_m),
        start.y_m + share * (end.y_m - start.y_m),
        start.yaw_rad + share * wrap_angle(end.yaw_rad - start.yaw_rad),
    )
