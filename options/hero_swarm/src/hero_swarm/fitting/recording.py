"""The recording of one robot. Pure."""

from typing import NamedTuple

import numpy as np

from hero_client.values import WHEEL_SEPARATION_M

VELOCITY, PULSES = 0, 1
"""Kinds of commands."""

SAMPLE_S = 0.05

_SLIP_WINDOW = 20
"""Samples, over which wheels and poses are compared."""
_MIN_ROLLED_M, _MAX_MOVED_SHARE = 0.02, 0.5
"""Wheels that roll farther than this, and poses that move by less than this share of it, are of a robot at a wall."""


class Recording(NamedTuple):
    """One robot; times in s from the start.

    Attributes:
        commands: time, kind, linear m/s and angular rad/s or left and right servo pulse us (C, 4).
        odometry: time, x m, y m, yaw rad, by the ticks of nominal wheels (T, 4).
        poses: time, x m, y m, yaw rad in a fixed frame (P, 4).
    """

    commands: np.ndarray
    odometry: np.ndarray
    poses: np.ndarray

    @property
    def time_s(self) -> float:
        """Time of the last odometry."""
        return float(self.odometry[-1, 0])

    @property
    def has_pulses(self) -> bool:
        """Presence of servo pulses among its commands: only these tell motors."""
        return bool((self.commands[:, 1] == PULSES).any())

    def cut(self, share: float) -> "Recording":
        """Return its first share, with all commands."""
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


def find_slips(recording: Recording) -> np.ndarray:
    """Return the times (s) of samples at which wheels turn while the pose rests, as at a wall (K,)."""
    times_s = sample_times(recording)
    times_s = times_s[(times_s >= recording.poses[0, 0]) & (times_s <= recording.poses[-1, 0])]
    if len(times_s) <= _SLIP_WINDOW:
        return np.empty(0)
    wheels_m, poses = measure_wheels(recording, times_s), interpolate_poses(recording.poses, times_s)
    rolled_m, moved = (values[_SLIP_WINDOW:] - values[:-_SLIP_WINDOW] for values in (wheels_m, poses))
    # A wheel's contact moves with the body's center and its turn.
    moved_m = np.hypot(moved[:, 0], moved[:, 1]) + np.abs(moved[:, 2]) * WHEEL_SEPARATION_M / 2.0
    rolled_m = np.abs(rolled_m.mean(axis=1)) + np.abs(np.diff(rolled_m, axis=1)[:, 0]) / 2.0
    slips: np.ndarray = times_s[_SLIP_WINDOW:][(rolled_m > _MIN_ROLLED_M) & (moved_m < _MAX_MOVED_SHARE * rolled_m)]
    return slips


def interpolate_poses(poses: np.ndarray, times_s: np.ndarray) -> np.ndarray:
    """Return x m, y m, yaw rad (K, 3) at these times (K,), from poses with their times (P, 4)."""
    columns = (*poses[:, 1:3].T, np.unwrap(poses[:, 3]))
    return np.column_stack([np.interp(times_s, poses[:, 0], column) for column in columns])
