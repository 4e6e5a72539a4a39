"""The recording of one robot. Pure."""

from typing import NamedTuple, Tuple

import numpy as np

from hero_client.values import WHEEL_SEPARATION_M

VELOCITY, PULSES = 0, 1
"""Kinds of commands."""

SAMPLE_S = 0.05

NO_SCANS = np.empty((0, 9))


class Recording(NamedTuple):
    """One robot; times in s from the start.

    Attributes:
        commands: time, kind, linear m/s and angular rad/s or left and right servo pulse us (C, 4).
        odometry: time, x m, y m, yaw rad, by the ticks of nominal wheels (T, 4).
        poses: time, x m, y m, yaw rad in a fixed frame (P, 4).
        scans: time, and the signals of the eight infrared sensors in counts, rear first (S, 9).
        others: poses of the other robots.
    """

    commands: np.ndarray
    odometry: np.ndarray
    poses: np.ndarray
    scans: np.ndarray = NO_SCANS
    others: Tuple[np.ndarray, ...] = ()

    @property
    def time_s(self) -> float:
        """Time of the last odometry."""
        return float(self.odometry[-1, 0])

    def cut(self, share: float) -> "Recording":
        """Return its first share, with all commands and scans."""
        odometry = self.odometry[self.odometry[:, 0] <= share * self.time_s]
        return self._replace(odometry=odometry, poses=self.poses[self.poses[:, 0] <= odometry[-1, 0]])


def sample_times(recording: Recording) -> np.ndarray:
    """Return the times (s) at which a robot in the simulator is compared."""
    return np.arange(1, int(recording.time_s / SAMPLE_S)) * SAMPLE_S


def measure_wheels(recording: Recording, times_s: np.ndarray) -> np.ndarray:
    """Return how far the ticks say that both wheels have rolled at these times, m (T, 2)."""
    _, x_m, y_m, yaw_rad = recording.odometry.T
    turns_rad = np.diff(np.unwrap(yaw_rad))
    middle_rad = yaw_rad[:-1] + turns_rad / 2.0
    paths_m = np.diff(x_m) * np.cos(middle_rad) + np.diff(y_m) * np.sin(middle_rad)
    halves_m = turns_rad * (WHEEL_SEPARATION_M / 2.0)
    rolled_m = np.cumsum(np.vstack(([(0.0, 0.0)], np.column_stack((paths_m - halves_m, paths_m + halves_m)))), axis=0)
    return np.column_stack([np.interp(times_s, recording.odometry[:, 0], column) for column in rolled_m.T])


def interpolate_poses(poses: np.ndarray, times_s: np.ndarray) -> np.ndarray:
    """Return x m, y m, yaw rad (K, 3) at these times (K,), from poses with their times (P, 4)."""
    columns = (*poses[:, 1:3].T, np.unwrap(poses[:, 3]))
    return np.column_stack([np.interp(times_s, poses[:, 0], column) for column in columns])
