"""Lateness of a loop that drives by poses: it slows its robots down, then stops them, and says why. Pure.

A command is right for where a robot was, and holds until the next one. Between the two the robot drives unseen for the
age of its pose and the period of the loop; the distance must stay within what controllers keep free around it.
"""

import math
from typing import Iterable, List

from hero_node import Velocity

PERIOD_S = 0.1
"""Period that the laws of hero_client are made for."""

COVERED_S = 0.1
"""Up to this late robots drive at full speed: at 0.08 m/s they use 8 mm of the margin of AvoidanceLaw, 12 mm; 4 mm
are left for wrong odometry. The safety filter's speeds, up to 0.2 m/s, are in proportion to what is left between two
robots (4 1/s): in its 0.05 s and this they close 0.6 of it, whatever the speed."""

STOP_S = 0.9
"""Robots whose commands come later than this are stopped: drivers would stop and start them in turns."""

HOLD_S = 2.0
"""The longest period counts for this long: a busy PC is late again and again."""

REPORT_PERIOD_S = 5.0


class Lateness:
    """Period of one loop; call step() once in each of its steps, then slow() for each robot."""

    def __init__(self, planned_s: float = PERIOD_S) -> None:
        """planned_s: period of the loop when it is on time."""
        self._planned_s = planned_s
        self._stepped_s = math.nan
        self._period_s = planned_s
        self._held_until_s = self._now_s = self._next_report_s = -math.inf
        self._worst_late_s = self._worst_age_s = 0.0

    def step(self, now_s: float) -> None:
        """Begin a step at now_s, by any clock that never steps back."""
        period_s = self._planned_s if math.isnan(self._stepped_s) else now_s - self._stepped_s
        self._stepped_s = self._now_s = now_s
        if period_s >= self._period_s or now_s > self._held_until_s:
            self._period_s, self._held_until_s = period_s, now_s + HOLD_S
        self._worst_late_s = self._worst_age_s = 0.0

    def find_share(self, pose_age_s: float) -> float:
        """Return the share, 0 to 1, of its speed at which a robot may drive whose pose is this old."""
        age_s = max(0.0, pose_age_s)
        late_s = self._period_s - self._planned_s + age_s
        if late_s > self._worst_late_s:
            self._worst_late_s, self._worst_age_s = late_s, age_s
        covered_s = self._planned_s + COVERED_S
        return 0.0 if late_s > STOP_S else covered_s / max(self._planned_s + late_s, covered_s)

    def slow(self, command: Velocity, pose_age_s: float = 0.0) -> Velocity:
        """Return a command as slow as it must be, on the same curve."""
        share = self.find_share(pose_age_s)
        return Velocity(command.linear_m_s * share, command.angular_rad_s * share)

    def find_shares(self, pose_ages_s: Iterable[float]) -> List[float]:
        """Return find_share() of each robot; ages of robots without a pose, which are not finite, do not count."""
        return [self.find_share(age_s if math.isfinite(age_s) else 0.0) for age_s in pose_ages_s]

    def take_warning(self) -> str:
        """Return why robots are slow in this step, for users, every REPORT_PERIOD_S; empty if they are not."""
        late_s, age_s = self._worst_late_s, self._worst_age_s
        if late_s <= COVERED_S or self._now_s < self._next_report_s:
            return ""
        self._next_report_s = self._now_s + REPORT_PERIOD_S
        cause = f"commands are late by {late_s:.1f} s: this PC is busy"
        if age_s > late_s / 2.0:
            cause = f"poses are {age_s:.1f} s old: is Wi-Fi or this PC overloaded?"
        if late_s > STOP_S:
            return cause + "; robots are stopped meanwhile"
        share = (self._planned_s + COVERED_S) / (self._planned_s + late_s)
        return f"{cause}; robots drive at {100.0 * share:.0f} percent meanwhile"
