"""The clocks of the sources of measured poses: by how much stamps are late, by the motions that odometry saw too. Pure.

Two poses of a robot span a motion; of stamps that are late, odometry between them tells another one whenever the robot
changes its speed or turns otherwise. Two cameras that see one robot are compared in any motion. A Kalman filter of the
delays of all sources joins this. Delays are relative to odometry, whose stamps are the robots' driver's.
"""

import math
from typing import Dict, List, Optional, Tuple

import numpy as np

from hero_node import Pose, clamp, invert_pose, transform_pose, wrap_angle

from .odometry_history import KEPT_S, OdometryHistory
from .pose_hypothesis import StampedPose, invert

SPAN_S = 0.3
"""Time between two poses of a source that are compared."""

MAX_POSES = 8
"""Poses of a robot and a source that wait for odometry."""

PAIRS_HZ = 50.0
"""Comparisons in a second, of all robots: each takes 0.2 ms."""

START_SD_S, SURE_SDS = 0.15, 3.0
"""Standard deviation of a delay before all comparisons; those by which a delay that is named differs from none."""
DRIFT_S2_S = 1e-8
STEP_S = (0.02, 0.1)
"""Least and most by which delays are varied to see what they change: as far as they are unknown."""

NAMED_S, SETTLED_S = 0.01, 0.005
"""A delay is named and corrected from the first on, until it is below the second: network and exposure take as much."""

CONFIRMED_S = 5.0
"""A delay is named after this long. Robots set their clocks every 2.5 s, ahead by the time in which a busy driver comes
to answer: for some time, a camera may seem early by as much."""

SLEW = 0.05
"""Most that a correction changes in a second, s: faster, poses would seem to be of robots moved by hand."""

ODOMETRY_SHARE = 0.03
"""Error of odometry: wheels and their slip."""

BIAS_M, BIAS_RAD = 0.002, 0.005
"""Differences of two cameras that are no matter of time."""

GATE = 16.3
"""Squared Mahalanobis distance of outliers, as in pose_hypothesis: a blocked or carried robot."""

BENT = 0.5
"""Error of what a delay changes, by that: variances."""

DOUBT = 2.0
"""By how much an outlier increases the variance of a delay: after many, it is sought anew."""

MIN_EFFECT = 0.1
"""A comparison counts if a delay of START_SD_S would change it by this many standard deviations."""


class _Source:
    """One source, what is corrected of its delay, when that was found, and since when it is off."""

    def __init__(self, name: str) -> None:
        self.name, self.is_off = name, False
        self.corrected_s, self.now_s, self.off_s = 0.0, math.inf, math.inf


class SourceClocks:
    """Delays of all sources."""

    def __init__(self, is_correcting: bool) -> None:
        """is_correcting: stamps are corrected as soon as a delay is known."""
        self._slew = SLEW if is_correcting else 0.0
        self._sources: List[_Source] = []
        self._delays_s, self._covariance = np.zeros(0), np.zeros((0, 0))
        self._poses: Dict[Tuple[int, int], List[StampedPose]] = {}
        """SPAN_S apart, by robot and source: odometry of their time has not come yet."""
        self._due_s: Dict[Tuple[int, int], float] = {}

    def list_off(self) -> Dict[str, str]:
        """Return by how much clocks are off, and the remedy, by the nodes that poses come from."""
        off, corrected = {}, ", which is corrected" if self._slew else ""
        for source, delay_s in zip(self._sources, self._delays_s.tolist()):
            if source.is_off and source.now_s >= source.off_s + CONFIRMED_S:
                side = "late" if delay_s > 0.0 else "early"
                text = f"poses from {source.name} come with stamps {1e3 * abs(delay_s):.0f} ms {side}{corrected}"
                off[source.name] = text + ": run chrony on all machines, or set its delay_s"
        return off

    def correct(self, robot_id: int, measurement: StampedPose, odometry: OdometryHistory, now_s: float) -> StampedPose:
        """Take a measured pose with its own stamp; return it with the time at which it was true, as far as known.

        odometry: that of its robot.
        """
        index = self._find_source(measurement.node)
        self._add(robot_id, index, measurement, odometry)
        source, delay_s = self._sources[index], self._delays_s.item(index)
        if SURE_SDS * math.sqrt(self._covariance.item(index, index)) < max(abs(delay_s), NAMED_S):
            was_off, source.is_off = source.is_off, abs(delay_s) > (SETTLED_S if source.is_off else NAMED_S)
            source.off_s = source.off_s if was_off else now_s
            missing_s = (delay_s if source.is_off else 0.0) - source.corrected_s
            source.corrected_s += clamp(missing_s, self._slew * max(0.0, now_s - source.now_s))
        source.now_s = now_s
        return measurement._replace(stamp_s=measurement.stamp_s - source.corrected_s)

    def is_settled(self, node: str) -> bool:
        """Return whether the delay of a node's stamps is known and corrected."""
        index = self._find_source(node)
        missing_s = self._delays_s.item(index) - self._sources[index].corrected_s
        return abs(missing_s) + SURE_SDS * math.sqrt(self._covariance.item(index, index)) < 2.0 * NAMED_S

    def _find_source(self, name: str) -> int:
        """Return the index of a node."""
        for index, source in enumerate(self._sources):
            if source.name == name:
                return index
        self._sources.append(_Source(name))
        self._delays_s = np.append(self._delays_s, 0.0)
        self._covariance = np.pad(self._covariance, (0, 1), "constant")
        self._covariance[-1, -1] = START_SD_S**2
        return len(self._sources) - 1

    def forget_poses(self) -> None:
        """Compare none of the poses that came: the clock was set."""
        self._poses.clear()
        self._due_s.clear()

    def _add(self, robot_id: int, source: int, measurement: StampedPose, odometry: OdometryHistory) -> None:
        key, stamp_s = (robot_id, source), measurement.stamp_s
        if stamp_s < self._due_s.get(key, -math.inf):
            return
        poses = self._poses.setdefault(key, [])
        if poses and abs(stamp_s - poses[-1].stamp_s) > KEPT_S:
            poses.clear()  # after a pause, or a clock that was set back
        if not poses or stamp_s >= poses[-1].stamp_s + SPAN_S:
            poses.append(measurement)
            del poses[:-MAX_POSES]
        reach_s = STEP_S[1] - self._delays_s.item(source)
        if len(poses) < 2 or odometry.newest_s < poses[1].stamp_s + reach_s:
            return  # its odometry is not there yet
        first, second = poses[:2]
        del poses[0]
        self._compare(first, second, odometry)
        for (robot, other), others in self._poses.items():
            if robot == robot_id and other != source and others:
                self._compare(others[0], second, odometry)
        wait_s = len(self._poses) / PAIRS_HZ - SPAN_S
        if wait_s > 0.0:
            poses.clear()
            self._due_s[key] = stamp_s + wait_s

    def _compare(self, first: StampedPose, second: StampedPose, odometry: OdometryHistory) -> None:
        """Correct the delays by two poses of a robot."""
        both = [self._find_source(sample.node) for sample in (first, second)]
        sources = sorted(set(both))
        stamps_s = np.array((first.stamp_s, second.stamp_s)) - self._delays_s[both]

        def move(source: int, step_s: float) -> Optional[Pose]:
            """Return the motion by odometry if the delay of a source were larger."""
            steps = [odometry.find(at_s - step_s * (one == source)) for one, at_s in zip(both, stamps_s.tolist())]
            start, end = (None if step is None else step.pose for step in steps)
            return None if start is None or end is None else transform_pose(invert_pose(start), end)

        counted = move(-1, 0.0)
        effects = np.zeros((3, len(self._sources)))
        # The same for both, or what they have in common would seem to be seen as well.
        step_s = min(max(math.sqrt(max(self._covariance[sources, sources])), STEP_S[0]), STEP_S[1])
        for source in sources:
            late, early = move(source, step_s), move(source, -step_s)
            if counted is None or late is None or early is None:
                return
            effects[:, source] = np.divide(_subtract(late, early), 2.0 * step_s)
        assert counted is not None
        seen = transform_pose(invert_pose(first.pose), second.pose)
        variances = [np.diagonal(sample.covariance) for sample in (first, second)]
        noise = sum(variances) + (ODOMETRY_SHARE * np.array(counted)) ** 2
        noise[:2] += variances[0][2] * (counted.x_m**2 + counted.y_m**2)
        if len(sources) > 1:
            noise += (BIAS_M**2, BIAS_M**2, BIAS_RAD**2)
        if not (np.abs(effects).max(axis=1) * START_SD_S > MIN_EFFECT * np.sqrt(noise)).any():
            return
        self._covariance[sources, sources] += DRIFT_S2_S
        told = effects @ self._covariance
        # More for what is not linear: delays that are hardly known are found in several steps.
        expected = told @ effects.T
        weight = invert(expected * (1.0 + BENT * np.eye(3)) + np.diag(noise))
        off = np.array(_subtract(seen, counted))
        if float(off @ weight @ off) > GATE:
            self._covariance[sources, sources] = np.minimum(DOUBT * self._covariance[sources, sources], START_SD_S**2)
            return
        gain = told.T @ weight
        self._delays_s = self._delays_s + gain @ off
        self._covariance = self._covariance - gain @ told


def _subtract(one: Pose, other: Pose) -> Tuple[float, float, float]:
    return one.x_m - other.x_m, one.y_m - other.y_m, wrap_angle(one.yaw_rad - other.yaw_rad)
