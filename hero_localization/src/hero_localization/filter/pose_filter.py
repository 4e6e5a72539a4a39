"""The pose of one robot in the frame `map`: its odometry, corrected by poses that are measured from outside. Pure.

An extended Kalman filter of x, y and yaw. Odometry is the motion, not a measurement: between two measured poses the
estimate follows it exactly, and grows less certain with each meter and radian. A measured pose counts at the time at
which it was measured, not at which it arrived: the filter returns to that time, and replays the odometry
since then; one that is newer than the newest odometry waits for the next. The wheels of a robot that pushes a wall
slip: a measured pose that odometry cannot explain may still be one that the robot reached with slipping wheels.

Odometry is wrong by a scale rather than by chance: wheels of unequal size turn a robot by the same angle in each meter.
So its error grows with the distance since the last measured pose, not with the root of it.

Source: S. Thrun, W. Burgard, D. Fox, Probabilistic Robotics, chapters 3.3 and 5.4.
"""

import enum
import math
from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from hero_node.geometry import Pose, find_frame, invert_pose, measure_distance, transform_pose, wrap_angle

from .odometry_history import KEPT_S, Odometry, OdometryHistory

DISTANCE_SCALE_SD = 0.012
YAW_SCALE_SD_RAD_M = 0.065
TURN_SCALE_SD = 0.014
"""Standard deviations of the scale errors of path, heading by path, and turns, as measured on simulated robots."""

DISTANCE_VARIANCE_M2_M = 1.5e-5
YAW_VARIANCE_RAD2_M = 1e-3
YAW_VARIANCE_RAD2_RAD = 2e-4
"""Process noise: 4 mm (standard deviation) and 0.03 rad after a meter, 0.014 rad after a radian."""

SYSTEMATIC_M, SYSTEMATIC_RAD = 0.0007, 0.003
"""Of measured poses (standard deviations in x, y, and of yaw), what stays however many are joined: calibration."""

UNOBSERVED_M_S, UNOBSERVED_RAD_S = 0.2, 2.0
"""Assumed maximum speed while odometry is missing."""

SYSTEMATIC = np.array((SYSTEMATIC_M**2, SYSTEMATIC_M**2, SYSTEMATIC_RAD**2))

WAIT_S = 0.25
"""A measured pose waits this long for odometry; readings come every 0.034 s."""

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

MOVED_POSES = 4
MOVED_S = 0.1
"""Outliers in a row, and time between first and last, that agree with each other: the robot was kidnapped."""

MIN_MOVED_M, MIN_MOVED_RAD = 0.01, 0.1
"""No hand moves a robot by less: stamps of a busy computer are this far off while the robot drives."""

REPLAYED_S = 1.0
"""Poses that arrive later than this after a newer one are left out."""


class StampedPose(NamedTuple):
    """A pose of the robot in `map` at a time, and its covariance: measured from outside, or estimated."""

    stamp_s: float
    pose: Pose
    covariance: np.ndarray
    """Of x, y and yaw, (3, 3), m and rad."""


class Outcome(enum.Enum):
    """Outcome of a measured pose."""

    FIRST = "first"
    USED = "used"
    WAITING = "waiting"
    """For odometry of its time."""
    OUTLIER = "outlier"
    MOVED = "moved"
    """Used as a new start: the robot was moved by hand (kidnapped)."""
    TOO_LATE = "too late"
    NO_ODOMETRY = "no odometry"


class _Step(NamedTuple):
    """An estimate, and the measured pose that led to it from the one before; None for a start."""

    estimate: StampedPose
    odometry: Odometry
    """At that time."""
    measurement: Optional[StampedPose]
    is_blocked: bool = False
    """Whether the wheels slip in place, as at a wall: odometry then does not predict the motion."""


class PoseFilter:
    """Estimate of one robot.

    Attributes:
        odometry: what the robot drove by its own readings.
        used_s: stamp of the newest measured pose that was used; -inf before the first.
    """

    def __init__(self) -> None:
        self.odometry = OdometryHistory()
        self.used_s = -math.inf
        self._steps: List[_Step] = []
        self._rejected: List[StampedPose] = []
        self._waiting: List[StampedPose] = []
        self._systematic = SYSTEMATIC

    def add_odometry(self, stamp_s: float, pose: Pose) -> List[Tuple[StampedPose, Optional[Pose], Outcome]]:
        """Follow a reading of /hero_N/odom.

        Return measured poses that waited for it, each with the pose estimated before it, and what became of it.
        """
        newest_s = self.odometry.newest_s
        self.odometry.add(stamp_s, pose)
        if self.used_s > newest_s:  # measured while odometry was missing
            self._steps = [
                self._find_motion(step) if step.estimate.stamp_s > newest_s else step for step in self._steps
            ]
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
        stamp_s = measurement.stamp_s
        if self.odometry.find(stamp_s) is None:
            return Outcome.NO_ODOMETRY
        if not self._steps:
            self._start(measurement)
            return Outcome.FIRST
        count = len(self._steps)
        while count and self._steps[count - 1].estimate.stamp_s > stamp_s:
            count -= 1
        kept, later = self._steps[:count], self._steps[count:]
        if not kept:
            return Outcome.TOO_LATE
        step = self._correct(kept, measurement)
        if step is None:
            self._rejected = [*self._rejected[1 - MOVED_POSES :], measurement]
            if not self._was_moved():
                return Outcome.OUTLIER
            expected = self._predict(kept[-1], stamp_s).pose
            self._start(measurement)
            return Outcome.USED if _is_near(expected, measurement.pose) else Outcome.MOVED
        kept.append(step)
        for newer in later:
            replayed = self._correct(kept, newer.measurement) if newer.measurement else None
            if replayed is not None:
                kept.append(replayed)
        self._rejected.clear()
        self._keep(kept)
        self._note_systematic(measurement)
        return Outcome.USED

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

    def _make_step(self, estimate: StampedPose) -> _Step:
        return _Step(estimate, self._get_odometry(estimate.stamp_s), None)

    def _get_odometry(self, stamp_s: float) -> Odometry:
        odometry = self.odometry.find(stamp_s)
        assert odometry is not None, "poses without odometry of their time are not used"
        return odometry

    def _find_motion(self, step: _Step) -> _Step:
        odometry, newest = self.odometry.find(step.estimate.stamp_s), self._get_odometry(self.odometry.newest_s)
        if odometry is None:  # in a long pause: where the robot drove since then is unknown
            unobserved_s = newest.unobserved_s - (self.odometry.newest_s - step.estimate.stamp_s)
            odometry = newest._replace(unobserved_s=unobserved_s)
        return step._replace(odometry=odometry)

    def _start(self, measurement: StampedPose) -> None:
        self._rejected.clear()
        self._keep([self._make_step(measurement)])
        self._note_systematic(measurement)

    def _note_systematic(self, measurement: StampedPose) -> None:
        # Of a motion capture system that claims less, no more than it claims.
        self._systematic = np.minimum(SYSTEMATIC, np.diagonal(measurement.covariance))

    def _keep(self, steps: List[_Step]) -> None:
        self.used_s = steps[-1].estimate.stamp_s
        first = next(at for at, step in enumerate(steps) if step.estimate.stamp_s >= self.used_s - REPLAYED_S)
        self._steps = steps[first:]

    def _was_moved(self) -> bool:
        """Return whether the last outliers agree with each other, so that the estimate must be wrong."""
        last = [measurement for measurement in self._rejected if self.odometry.find(measurement.stamp_s) is not None]
        if len(last) < MOVED_POSES or last[-1].stamp_s - last[0].stamp_s < MOVED_S:
            return False
        step = self._make_step(last[0])
        for measurement in last[1:]:
            if measurement.stamp_s < step.estimate.stamp_s:
                return False
            updated = self._update(self._predict(step, measurement.stamp_s), measurement)
            if updated is None:
                return False
            step = self._make_step(updated)
        return True

    def _predict(self, step: _Step, stamp_s: float) -> StampedPose:
        """Return the estimate of a step moved on to stamp_s by the odometry since."""
        start, end = step.estimate, self._get_odometry(stamp_s)
        pose = _follow(step, end)
        moved_x_m, moved_y_m = pose.x_m - start.pose.x_m, pose.y_m - start.pose.y_m
        driven_m, turned_rad = end.distance_m - step.odometry.distance_m, end.turned_rad - step.odometry.turned_rad
        elapsed_s = stamp_s - start.stamp_s
        unobserved_s = end.unobserved_s - step.odometry.unobserved_s
        unobserved_s += max(0.0, stamp_s - max(start.stamp_s, self.odometry.newest_s))
        # A wrong heading at the start leads to a wrong place at the end.
        jacobian = np.array(((1.0, 0.0, -moved_y_m), (0.0, 1.0, moved_x_m), (0.0, 0.0, 1.0)))
        place_m2 = (DISTANCE_SCALE_SD * driven_m) ** 2 + DISTANCE_VARIANCE_M2_M * driven_m
        place_m2 += IDLE_VARIANCE_M2_S * elapsed_s + (UNOBSERVED_M_S * unobserved_s) ** 2
        yaw_rad2 = YAW_VARIANCE_RAD2_M * driven_m + YAW_VARIANCE_RAD2_RAD * turned_rad
        yaw_rad2 += IDLE_VARIANCE_RAD2_S * elapsed_s + (UNOBSERVED_RAD_S * unobserved_s) ** 2
        # One that grows evenly along the path leads half as far astray.
        drift_rad2 = (YAW_SCALE_SD_RAD_M * driven_m) ** 2
        drift_rad2 += (TURN_SCALE_SD * (end.heading_rad - step.odometry.heading_rad)) ** 2
        astray = np.array((-moved_y_m / 2.0, moved_x_m / 2.0, 1.0))
        growth = np.array(((place_m2, 0.0, 0.0), (0.0, place_m2, 0.0), (0.0, 0.0, yaw_rad2)))
        growth += drift_rad2 * (astray[:, None] * astray)
        return StampedPose(stamp_s, pose, jacobian @ start.covariance @ jacobian.T + growth)

    @staticmethod
    def _update(predicted: StampedPose, measurement: StampedPose) -> Optional[StampedPose]:
        """Return the estimate corrected by a measured pose of the same time; None for an outlier."""
        seen, expected = measurement.pose, predicted.pose
        innovation = np.array(
            (seen.x_m - expected.x_m, seen.y_m - expected.y_m, wrap_angle(seen.yaw_rad - expected.yaw_rad))
        )
        weight = _invert(predicted.covariance + measurement.covariance)
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

    def pose(self) -> Optional[Pose]:
        """Return where the robot is at its newest odometry; None before the first measured pose."""
        if not self._steps:
            return None
        step = self._steps[-1]
        pose = _follow(step, self._get_odometry(self.odometry.newest_s))
        is_blocked = step.is_blocked and self.odometry.newest_s - step.estimate.stamp_s <= MAX_BLOCKED_S
        return step.estimate.pose._replace(yaw_rad=pose.yaw_rad) if is_blocked else pose

    def estimate(self) -> Optional[StampedPose]:
        """Return pose() with its covariance; None before the first measured pose."""
        pose = self.pose()
        if pose is None:
            return None
        stamp_s = max(self._steps[-1].estimate.stamp_s, self.odometry.newest_s)
        covariance = self._predict(self._steps[-1], stamp_s).covariance
        return StampedPose(stamp_s, pose, covariance + np.diag(self._systematic))

    def find_odom_origin(self, pose: Pose) -> Pose:
        """Return where the frame hero_N/odom is in `map` if the robot is at pose, that of estimate()."""
        assert self.odometry.raw_pose is not None, "no pose is measured before the first reading"
        return find_frame(pose, self.odometry.raw_pose)


def make_covariance(position_sd_m: float, yaw_sd_rad: float) -> np.ndarray:
    """Return the covariance of x, y and yaw, (3, 3), of independent errors; position_sd_m: in x and y each."""
    return np.diag((position_sd_m**2, position_sd_m**2, yaw_sd_rad**2))


def _follow(step: _Step, odometry: Odometry) -> Pose:
    return transform_pose(step.estimate.pose, transform_pose(invert_pose(step.odometry.pose), odometry.pose))


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


def _is_near(one: Pose, other: Pose) -> bool:
    turned_rad = abs(wrap_angle(other.yaw_rad - one.yaw_rad))
    return measure_distance(one, other) < MIN_MOVED_M and turned_rad < MIN_MOVED_RAD


def _invert(matrix: np.ndarray) -> np.ndarray:
    """Return the inverse of a symmetric matrix (3, 3); LAPACK takes five times as long for one so small."""
    (a, b, c), (_, d, e), (_, _, f) = matrix.tolist()
    first, second, third = d * f - e * e, c * e - b * f, b * e - c * d
    fourth, fifth, sixth = a * f - c * c, b * c - a * e, a * d - b * b
    adjugate = ((first, second, third), (second, fourth, fifth), (third, fifth, sixth))
    return np.array(adjugate) / (a * first + b * second + c * third)


def _check(measurement: StampedPose) -> None:
    covariance = np.asarray(measurement.covariance, dtype=float)
    if not all(map(math.isfinite, (measurement.stamp_s, *measurement.pose))):
        raise ValueError("a measured pose must be finite, not %r" % (measurement.pose,))
    if covariance.shape != (3, 3) or not np.isfinite(covariance).all() or not (covariance.diagonal() > 0.0).all():
        raise ValueError("a covariance of x, y and yaw must be 3 by 3 with variances above 0")
    (a, b, c), (_, d, e), (_, _, f) = covariance.tolist()
    if a * d <= b * b or a * (d * f - e * e) <= b * (b * f - c * e) - c * (b * e - c * d):
        raise ValueError("a covariance must be positive definite, not %s" % covariance.tolist())
