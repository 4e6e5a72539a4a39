"""One hypothesis of where a robot is in the frame `map`: its odometry, corrected by measured poses that agree. Pure.

An extended Kalman filter of x, y and yaw. Odometry is the motion, not a measurement: between two measured poses the
estimate follows it exactly, and grows less certain with each meter and radian. A measured pose counts at the time at
which it was measured, not at which it arrived: the filter returns to that time, and replays the odometry
since then. The wheels of a robot that pushes a wall slip: a measured pose that odometry cannot explain may still be
one that the robot reached with slipping wheels.

Odometry is wrong by a scale rather than by chance: wheels of unequal size turn a robot by the same angle in each meter.
So its error grows with the distance since the last measured pose, not with the root of it.

Source: S. Thrun, W. Burgard, D. Fox, Probabilistic Robotics, chapters 3.3 and 5.4.
"""

import math
from typing import NamedTuple, Optional, Sequence

import numpy as np

from hero_node import Pose, measure_distance, wrap_angle

from .odometry_history import Odometry, OdometryHistory

DISTANCE_SCALE_SD = 0.012
YAW_SCALE_SD_RAD_M = 0.065
TURN_SCALE_SD = 0.014
"""Standard deviations of the scale errors of path, heading by path, and turns, as measured on simulated robots."""

DISTANCE_VARIANCE_M2_M = 1.5e-5
YAW_VARIANCE_RAD2_M = 1e-3
YAW_VARIANCE_RAD2_RAD = 2e-4
"""Process noise: 4 mm (standard deviation) and 0.03 rad after a meter, 0.014 rad after a radian."""

UNOBSERVED_M_S, UNOBSERVED_RAD_S = 0.2, 2.0
"""Assumed maximum speed while odometry is missing."""

IDLE_VARIANCE_M2_S = 1e-8
IDLE_VARIANCE_RAD2_S = 1e-7
"""A robot at rest is pushed now and then: 0.1 mm and 0.02 degrees after one second."""

SLIP_M, SLIP_RAD = 0.06, 0.6
"""At most this much of what odometry counted since the last measured pose may be slip; what exceeds that was a jump."""

BLOCKED_S = (0.09, 0.5)
BLOCKED_SHARE, MIN_SLIP_M = 0.4, 0.005
"""A robot that came less far than this share of what odometry counted, over a time between these, is blocked."""

MAX_BLOCKED_S = 2.0
"""A blocked robot that was not measured for longer may have driven away."""

GATE = 16.3
"""A measured pose whose squared Mahalanobis distance is larger than this is an outlier: chi-squared, three degrees of
freedom, one of 1,000 true ones."""

REPLAYED_S = 1.0
"""Poses that arrive later than this after a newer one are left out."""


class StampedPose(NamedTuple):
    """A pose of the robot in `map` at a time, and its covariance: measured from outside, or estimated."""

    stamp_s: float
    pose: Pose
    covariance: np.ndarray
    """Covariance of x, y and yaw, (3, 3), m and rad."""
    source: str = ""
    """Topic and node that a measured pose came from; empty if unknown."""
    is_systematic: bool = False
    """True if its errors stay however many are joined, as those of a camera's calibration do."""

    @property
    def node(self) -> str:
        """Node that a measured pose came from: one clock and one camera, whatever the number of topics."""
        return self.source.rpartition("(")[2].rstrip(")")


class _Step(NamedTuple):
    """An estimate, and the measured pose that led to it from the one before; None for a start."""

    estimate: StampedPose
    odometry: Odometry
    """At that time."""
    measurement: Optional[StampedPose]
    is_blocked: bool = False
    """True if the wheels slip in place, as at a wall: odometry then does not predict the motion."""


class Hypothesis:
    """Estimates of one robot, each from the one before by odometry and a measured pose.

    support: number of measured poses that agree with it, less those that a caller counts against it.
    first_s: stamp of the first of them.
    """

    def __init__(self, odometry: OdometryHistory, first: StampedPose) -> None:
        """Begin with a measured pose of a time that odometry knows."""
        self._odometry = odometry
        self._steps = [_Step(first, self._get_odometry(first.stamp_s), None)]
        self.first_s = first.stamp_s
        self.support = 1

    @property
    def oldest_s(self) -> float:
        """Stamp before which no measured pose can be added any more."""
        return self._steps[0].estimate.stamp_s

    @property
    def newest_s(self) -> float:
        """Stamp of the newest measured pose."""
        return self._steps[-1].estimate.stamp_s

    def add(self, measurement: StampedPose) -> bool:
        """Correct the estimates from the time of a measured pose on, from oldest_s; return False for an outlier."""
        count = self._count_until(measurement.stamp_s)
        kept, later = self._steps[:count], self._steps[count:]
        step = self._correct(kept, measurement)
        if step is None:
            return False
        kept.append(step)
        for newer in later:
            replayed = self._correct(kept, newer.measurement) if newer.measurement else None
            if replayed is not None:
                kept.append(replayed)
        while kept[0].estimate.stamp_s < kept[-1].estimate.stamp_s - REPLAYED_S:
            del kept[0]
        self._steps = kept
        self.support += 1
        return True

    def _count_until(self, stamp_s: float) -> int:
        """Return the number of estimates that are not newer than stamp_s."""
        count = len(self._steps)
        while count and self._steps[count - 1].estimate.stamp_s > stamp_s:
            count -= 1
        return count

    def follow_pause(self, start_s: float) -> None:
        """Take the motion of estimates after start_s from readings that came since: odometry was missing there."""
        self._steps = [self._find_motion(step) if step.estimate.stamp_s > start_s else step for step in self._steps]

    def _find_motion(self, step: _Step) -> _Step:
        odometry, newest = self._odometry.find(step.estimate.stamp_s), self._get_odometry(self._odometry.newest_s)
        if odometry is None:  # in a long pause: where the robot drove since then is unknown
            unobserved_s = newest.unobserved_s - (self._odometry.newest_s - step.estimate.stamp_s)
            odometry = newest._replace(unobserved_s=unobserved_s)
        return step._replace(odometry=odometry)

    def _correct(self, steps: Sequence[_Step], measurement: StampedPose) -> Optional[_Step]:
        """Return the step from the last of steps to a measured pose; None for an outlier."""
        start = steps[-1].estimate
        predicted = self._predict(steps[-1], measurement.stamp_s)
        estimate = self._update(predicted, measurement)
        if estimate is None:
            driven_m = measure_distance(start.pose, predicted.pose)
            turned_rad = abs(wrap_angle(predicted.pose.yaw_rad - start.pose.yaw_rad))
            if driven_m <= SLIP_M and turned_rad <= SLIP_RAD:
                slip = np.diag((driven_m**2, driven_m**2, turned_rad**2))
                estimate = self._update(predicted._replace(covariance=predicted.covariance + slip), measurement)
        if estimate is None:
            return None
        odometry = self._get_odometry(measurement.stamp_s)
        return _Step(estimate, odometry, measurement, _is_blocked(steps, measurement, odometry))

    def _get_odometry(self, stamp_s: float) -> Odometry:
        odometry = self._odometry.find(stamp_s)
        assert odometry is not None, "poses without odometry of their time are not used"
        return odometry

    def _predict(self, step: _Step, stamp_s: float) -> StampedPose:
        """Return the estimate of a step moved on to stamp_s by the odometry since."""
        start, end = step.estimate, self._get_odometry(stamp_s)
        pose = _follow(step, end)
        moved_x_m, moved_y_m = pose.x_m - start.pose.x_m, pose.y_m - start.pose.y_m
        driven_m, turned_rad = end.distance_m - step.odometry.distance_m, end.turned_rad - step.odometry.turned_rad
        elapsed_s = stamp_s - start.stamp_s
        unobserved_s = end.unobserved_s - step.odometry.unobserved_s
        unobserved_s += max(0.0, stamp_s - max(start.stamp_s, self._odometry.newest_s))
        place_m2 = (DISTANCE_SCALE_SD * driven_m) ** 2 + DISTANCE_VARIANCE_M2_M * driven_m
        place_m2 += IDLE_VARIANCE_M2_S * elapsed_s + (UNOBSERVED_M_S * unobserved_s) ** 2
        yaw_rad2 = YAW_VARIANCE_RAD2_M * driven_m + YAW_VARIANCE_RAD2_RAD * turned_rad
        yaw_rad2 += IDLE_VARIANCE_RAD2_S * elapsed_s + (UNOBSERVED_RAD_S * unobserved_s) ** 2
        drift_rad2 = (YAW_SCALE_SD_RAD_M * driven_m) ** 2
        drift_rad2 += (TURN_SCALE_SD * (end.heading_rad - step.odometry.heading_rad)) ** 2
        # A wrong heading at the start leads to a wrong place at the end; one that grows evenly along the path, half as
        # far astray. In single numbers: numpy takes three times as long for matrices so small.
        (xx, xy, xt), (_, yy, yt), (_, _, tt) = start.covariance.tolist()
        both_rad2, half_rad2 = tt + drift_rad2 / 4.0, tt + drift_rad2 / 2.0
        xy += moved_x_m * xt - moved_y_m * yt - moved_x_m * moved_y_m * both_rad2
        xx += place_m2 - 2.0 * moved_y_m * xt + moved_y_m**2 * both_rad2
        yy += place_m2 + 2.0 * moved_x_m * yt + moved_x_m**2 * both_rad2
        xt, yt, tt = xt - moved_y_m * half_rad2, yt + moved_x_m * half_rad2, tt + yaw_rad2 + drift_rad2
        return StampedPose(stamp_s, pose, np.array(((xx, xy, xt), (xy, yy, yt), (xt, yt, tt))))

    @staticmethod
    def _update(predicted: StampedPose, measurement: StampedPose) -> Optional[StampedPose]:
        """Return the estimate corrected by a measured pose of the same time; None for an outlier."""
        seen, expected = measurement.pose, predicted.pose
        innovation = np.array(
            (seen.x_m - expected.x_m, seen.y_m - expected.y_m, wrap_angle(seen.yaw_rad - expected.yaw_rad))
        )
        weight = invert(predicted.covariance + measurement.covariance)
        if float(innovation @ weight @ innovation) > GATE:
            return None
        gain = predicted.covariance @ weight
        change = gain @ innovation
        pose = Pose(
            expected.x_m + float(change[0]),
            expected.y_m + float(change[1]),
            wrap_angle(expected.yaw_rad + float(change[2])),
        )
        # The same as (1 - gain) @ predicted.covariance, but exact however large that is.
        covariance = gain @ measurement.covariance
        return StampedPose(predicted.stamp_s, pose, (covariance + covariance.T) / 2.0)

    def expect(self, stamp_s: float) -> Pose:
        """Return where the robot was, or is, at a time from oldest_s on."""
        return _follow(self._steps[self._count_until(stamp_s) - 1], self._get_odometry(stamp_s))

    def pose(self) -> Pose:
        """Return where the robot is at its newest odometry."""
        step = self._steps[-1]
        pose = _follow(step, self._get_odometry(self._odometry.newest_s))
        is_blocked = step.is_blocked and self._odometry.newest_s - step.estimate.stamp_s <= MAX_BLOCKED_S
        return step.estimate.pose._replace(yaw_rad=pose.yaw_rad) if is_blocked else pose

    def estimate(self) -> StampedPose:
        """Return pose() with its covariance."""
        estimate = self._predict(self._steps[-1], max(self.newest_s, self._odometry.newest_s))
        return estimate._replace(pose=self.pose()) if self._steps[-1].is_blocked else estimate


def _follow(step: _Step, odometry: Odometry) -> Pose:
    """Return where the robot of a step is by odometry since: each measured pose asks for it some times."""
    start, counted, newest = step.estimate.pose, step.odometry.pose, odometry.pose
    turn_rad = start.yaw_rad - counted.yaw_rad
    cos, sin, x_m, y_m = math.cos(turn_rad), math.sin(turn_rad), newest.x_m - counted.x_m, newest.y_m - counted.y_m
    yaw_rad = wrap_angle(turn_rad + newest.yaw_rad)
    return Pose(start.x_m + cos * x_m - sin * y_m, start.y_m + sin * x_m + cos * y_m, yaw_rad)


def _is_blocked(steps: Sequence[_Step], measurement: StampedPose, odometry: Odometry) -> bool:
    """Return whether the robot came nowhere since a pose measured a moment ago, though its wheels turned."""
    for step in reversed(steps):
        since_s = measurement.stamp_s - step.estimate.stamp_s
        if step.measurement is not None and since_s >= BLOCKED_S[0]:
            if since_s > BLOCKED_S[1]:
                return False
            counted_m = measure_distance(step.odometry.pose, odometry.pose)
            came_m = measure_distance(step.measurement.pose, measurement.pose)
            return counted_m > MIN_SLIP_M and came_m < BLOCKED_SHARE * counted_m
    return False


def invert(matrix: np.ndarray) -> np.ndarray:
    """Return the inverse of a symmetric matrix (3, 3); LAPACK takes five times as long for one so small."""
    (a, b, c), (_, d, e), (_, _, f) = matrix.tolist()
    first, second, third = d * f - e * e, c * e - b * f, b * e - c * d
    fourth, fifth, sixth = a * f - c * c, b * c - a * e, a * d - b * b
    adjugate = ((first, second, third), (second, fourth, fifth), (third, fifth, sixth))
    return np.array(adjugate) / (a * first + b * second + c * third)
