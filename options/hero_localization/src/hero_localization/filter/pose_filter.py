"""The pose of one robot in the frame `map`: its odometry, corrected by poses that are measured from outside. Pure.

Measured poses that agree with each other, and with odometry, are one hypothesis; the estimate is that of the main one.
Outliers form a rival to it. The main one gives way to a rival that enough of them support for long enough: the robot
was moved by hand, or the main one began with a wrong pose. How often poses are measured does not matter, nor how many
cameras there are, or whether their poses come in order.

A measured pose that is newer than the newest odometry waits for the next.
"""

import enum
import math
from typing import List, Optional, Tuple

import numpy as np

from hero_node import Pose, measure_distance, wrap_angle

from .odometry_history import KEPT_S, OdometryHistory
from .pose_hypothesis import Hypothesis, StampedPose

SYSTEMATIC_M, SYSTEMATIC_RAD = 0.0007, 0.003
"""Errors of calibration in measured poses (standard deviations in x, y, and of yaw), however many are joined."""

SYSTEMATIC = np.array((SYSTEMATIC_M**2, SYSTEMATIC_M**2, SYSTEMATIC_RAD**2))

WAIT_S = 0.25
"""A measured pose waits this long for odometry; readings come every 0.034 s."""

MOVED_POSES = 4
MOVED_S = 0.1
"""Outliers that agree with each other, and time between first and last: the robot was kidnapped. One that disagrees
takes one away; one that agrees with the estimate, all."""

MIN_MOVED_M, MIN_MOVED_RAD = 0.01, 0.1
"""No hand moves a robot by less: stamps of a busy computer are this far off while the robot drives."""


class Outcome(enum.Enum):
    """Outcome of a measured pose."""

    FIRST = "first"
    """First pose of the robot, or the first true one: the estimate had begun with a wrong pose."""
    USED = "used"
    WAITING = "waiting"
    """For odometry of its time."""
    OUTLIER = "outlier"
    MOVED = "moved"
    """Used as a new start: the robot was moved by hand (kidnapped)."""
    TOO_LATE = "too late"
    """Older than odometry, or than what newer poses can be replayed from."""


class PoseFilter:
    """Estimate of one robot; odometry: what it drove by its own readings."""

    def __init__(self) -> None:
        self.odometry = OdometryHistory()
        self._main: Optional[Hypothesis] = None
        self._rival: Optional[Hypothesis] = None
        self._waiting: List[StampedPose] = []
        self._systematic = SYSTEMATIC

    @property
    def used_s(self) -> float:
        """Stamp of the newest measured pose that was used; -inf before the first."""
        return -math.inf if self._main is None else self._main.newest_s

    @property
    def support(self) -> int:
        """Number of measured poses that were used since the robot was found, or was moved by hand."""
        return 0 if self._main is None else self._main.support

    def add_odometry(self, stamp_s: float, pose: Pose) -> List[Tuple[StampedPose, Optional[Pose], Outcome]]:
        """Follow odometry; return measured poses that waited for it, each with the estimate before, and its outcome."""
        newest_s = self.odometry.newest_s
        self.odometry.add(stamp_s, pose)
        for hypothesis in (self._main, self._rival):
            if hypothesis is not None and hypothesis.newest_s > newest_s:  # measured while odometry was missing
                hypothesis.follow_pause(newest_s)
        if stamp_s > newest_s + KEPT_S:  # a pause: no odometry comes for what waits
            self._waiting.clear()
        due = [measurement for measurement in self._waiting if measurement.stamp_s <= stamp_s]
        self._waiting = [measurement for measurement in self._waiting if measurement.stamp_s > stamp_s]
        return [(measurement, self.pose(), self._use(measurement)) for measurement in due]

    def add_measurement(self, measurement: StampedPose) -> Outcome:
        """Correct the estimate by a measured pose, which may be older than others that were used.

        Raises: ValueError for numbers that are not finite, or an invalid covariance.
        """
        _check(measurement)
        ahead_s = measurement.stamp_s - self.odometry.newest_s
        if 0.0 < ahead_s <= WAIT_S:
            self._waiting.append(measurement)
            return Outcome.WAITING
        if ahead_s > WAIT_S:  # odometry has ended
            waiting, self._waiting = self._waiting, []
            for earlier in waiting:
                self._use(earlier)
        return self._use(measurement)

    def _use(self, measurement: StampedPose) -> Outcome:
        if self.odometry.find(measurement.stamp_s) is None:
            return Outcome.TOO_LATE
        outcome = Outcome.USED
        if self._main is None:
            self._main, outcome = Hypothesis(self.odometry, measurement), Outcome.FIRST
        elif measurement.stamp_s < self._main.oldest_s:
            return Outcome.TOO_LATE
        elif not self._main.add(measurement):
            expected = self._main.expect(measurement.stamp_s)
            if not self._was_moved(measurement):
                return Outcome.OUTLIER
            if not is_near(expected, measurement.pose):
                outcome = Outcome.MOVED if self._main.support >= MOVED_POSES else Outcome.FIRST
            self._main = self._rival
        self._rival = None
        # Of a motion capture system that claims less, no more than it claims.
        told = measurement.covariance.diagonal()
        self._systematic = told if measurement.is_systematic else np.minimum(SYSTEMATIC, told)
        return outcome

    def _was_moved(self, outlier: StampedPose) -> bool:
        """Return whether so many outliers agree, this one with them, that the estimate must be wrong."""
        rival = self._rival
        if rival is not None and outlier.stamp_s < rival.oldest_s:
            return False  # neither for the rival nor against it
        if rival is None or not rival.add(outlier):
            if rival is not None and rival.support > 1:
                rival.support -= 1
            else:
                self._rival = Hypothesis(self.odometry, outlier)
            return False
        return rival.support >= MOVED_POSES and rival.newest_s - rival.first_s >= MOVED_S

    def expect(self, stamp_s: float) -> Optional[Pose]:
        """Return where the robot was by the estimate at a time at which a measured pose could be used; else None."""
        if self._main is None or stamp_s < self._main.oldest_s or self.odometry.find(stamp_s) is None:
            return None
        return self._main.expect(stamp_s)

    def pose(self) -> Optional[Pose]:
        """Return where the robot is at its newest odometry; None before the first measured pose."""
        return None if self._main is None else self._main.pose()

    def estimate(self) -> Optional[StampedPose]:
        """Return pose() with its covariance; None before the first measured pose."""
        if self._main is None:
            return None
        estimate = self._main.estimate()
        estimate.covariance.ravel()[::4] += self._systematic
        return estimate


def make_covariance(position_sd_m: float, yaw_sd_rad: float) -> np.ndarray:
    """Return the covariance of x, y and yaw, (3, 3), of independent errors; position_sd_m: in x and y each."""
    return np.array(((position_sd_m**2, 0.0, 0.0), (0.0, position_sd_m**2, 0.0), (0.0, 0.0, yaw_sd_rad**2)))


def is_near(one: Pose, other: Pose) -> bool:
    """Return whether two poses are so near to each other that no hand moved the robot from one to the other."""
    turned_rad = abs(wrap_angle(other.yaw_rad - one.yaw_rad))
    return measure_distance(one, other) < MIN_MOVED_M and turned_rad < MIN_MOVED_RAD


def _check(measurement: StampedPose) -> None:
    if not all(map(math.isfinite, (measurement.stamp_s, *measurement.pose))):
        raise ValueError(f"holds a pose that is not finite: {measurement.pose!r}")
    entries = measurement.covariance.ravel().tolist()
    if measurement.covariance.shape != (3, 3) or not all(map(math.isfinite, entries)) or min(entries[::4]) <= 0.0:
        raise ValueError("holds a covariance of x, y and yaw that is not 3 by 3 with variances above 0")
    a, b, c, _, d, e, _, _, f = entries
    if a * d <= b * b or a * (d * f - e * e) <= b * (b * f - c * e) - c * (b * e - c * d):
        raise ValueError(f"holds a covariance that is not positive definite: {measurement.covariance.tolist()}")
