"""Computes paths, errors and delays from the recorded data of a robot. Pure: numpy only.

Units: m, rad, s. Times are the recorder's, seconds since 1970.
"""

from typing import NamedTuple, Optional, Sequence, Tuple

import numpy as np

from .observations import Origin, RobotObservations, Series

COMMAND_TIMEOUT_S = 2.0
"""The robot's watchdog stops it this long after a command."""

ODOMETRY_GAP_S = 0.5
"""Longer gaps in the odometry are shown; hotspots pause for 0.1 to 0.3 s."""

SAME_TIME_S = 0.2
"""A pose is compared with ground truth at most this far away in time."""


class Path(NamedTuple):
    """Poses over time."""

    times_s: np.ndarray
    stamps_s: np.ndarray
    x_m: np.ndarray
    y_m: np.ndarray
    yaw_rad: np.ndarray

    @property
    def length_m(self) -> float:
        """Distance traveled."""
        return float(np.hypot(np.diff(self.x_m), np.diff(self.y_m)).sum()) if len(self.x_m) else 0.0


class PoseErrors(NamedTuple):
    """Errors of odometry or localization over time."""

    times_s: np.ndarray
    position_m: np.ndarray
    yaw_rad: np.ndarray


def read_path(robot: RobotObservations) -> Path:
    """Return the path of a robot by odometry, in the shared frame, or in its own if there is none."""
    return transform_path(read_series(robot.odometry), robot.origins)


def read_series(series: Series) -> Path:
    """Return the path in odometry, ground truth or poses, in the frame that they have."""
    return Path(*series.columns()[:5])


def transform_path(path: Path, origins: Sequence[Origin]) -> Path:
    """Return a path transformed from a robot's odom frame to the frame of its origins."""
    if not origins:
        return path
    table = np.array(origins)
    # Poses before the first known origin belong to it as well.
    which = np.maximum(np.searchsorted(table[:, 0], path.times_s, side="right") - 1, 0)
    _, origin_x, origin_y, yaw_rad = table[which].T
    cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
    return path._replace(
        x_m=origin_x + cosine * path.x_m - sine * path.y_m,
        y_m=origin_y + sine * path.x_m + cosine * path.y_m,
        yaw_rad=wrap(path.yaw_rad + yaw_rad),
    )


def wrap(angle_rad: np.ndarray) -> np.ndarray:
    """Return angles within -pi to pi."""
    return np.arctan2(np.sin(angle_rad), np.cos(angle_rad))


def compute_odometry_errors(robot: RobotObservations) -> Optional[PoseErrors]:
    """Return the difference between odometry and ground truth of the same stamp; None without ground truth.

    Without an origin, odometry is aligned with the ground truth at its first pose.
    """
    return _compare(read_path(robot), read_series(robot.ground_truth), is_aligned=not robot.origins)


def compute_localization_errors(robot: RobotObservations) -> Optional[PoseErrors]:
    """Return the difference between poses by localization and ground truth of the same stamp; None without either.

    Their frames count as one: the simulator's map is its world.
    """
    return _compare(read_series(robot.poses), read_series(robot.ground_truth), is_aligned=False)


def _compare(path: Path, truth: Path, is_aligned: bool) -> Optional[PoseErrors]:
    """Return the errors of a path, after aligning its first known pose on request."""
    if not len(path.times_s) or len(truth.times_s) < 2:
        return None
    truth = Path(*(column[np.argsort(truth.stamps_s, kind="stable")] for column in truth))
    after = np.clip(np.searchsorted(truth.stamps_s, path.stamps_s), 1, len(truth.stamps_s) - 1)
    nearest_s = np.minimum(abs(path.stamps_s - truth.stamps_s[after - 1]), abs(path.stamps_s - truth.stamps_s[after]))
    path = Path(*(column[nearest_s <= SAME_TIME_S] for column in path))
    if not len(path.times_s):
        return None
    x_m = np.interp(path.stamps_s, truth.stamps_s, truth.x_m)
    y_m = np.interp(path.stamps_s, truth.stamps_s, truth.y_m)
    yaw_rad = np.interp(path.stamps_s, truth.stamps_s, np.unwrap(truth.yaw_rad))
    if is_aligned:
        angle_rad = yaw_rad[0] - path.yaw_rad[0]
        turned = transform_path(path, [Origin(0.0, 0.0, 0.0, angle_rad)])
        shift = Origin(0.0, x_m[0] - turned.x_m[0], y_m[0] - turned.y_m[0], 0.0)
        path = transform_path(turned, [shift])
    return PoseErrors(path.times_s, np.hypot(path.x_m - x_m, path.y_m - y_m), wrap(path.yaw_rad - yaw_rad))


def break_at_gaps(times_s: np.ndarray, values: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return a curve that is interrupted at gaps in the odometry."""
    gaps = np.flatnonzero(np.diff(times_s) > ODOMETRY_GAP_S) + 1
    return np.insert(times_s, gaps, times_s[gaps]), np.insert(values, gaps, np.nan)


def end_commands(
    times_s: np.ndarray, linear_m_s: np.ndarray, angular_rad_s: np.ndarray
) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return commands with a zero after each that was not followed within COMMAND_TIMEOUT_S."""
    if not len(times_s):
        return times_s, linear_m_s, angular_rad_s
    ends = np.flatnonzero(np.append(np.diff(times_s), np.inf) > COMMAND_TIMEOUT_S)
    return (
        np.insert(times_s, ends + 1, times_s[ends] + COMMAND_TIMEOUT_S),
        np.insert(linear_m_s, ends + 1, 0.0),
        np.insert(angular_rad_s, ends + 1, 0.0),
    )
