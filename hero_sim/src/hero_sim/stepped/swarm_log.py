"""Log of stepped robots, as arrays over time, worlds and robots. Pure."""

from typing import Dict, List

import numpy as np

from .robot_rows import RobotRows


class SwarmLog:
    """Rows (T) of W worlds with N robots each; every array is stacked when it is asked for.

    Attributes:
        time_s (T,): simulated seconds.
        pose (T, W, N, 3): x m, y m, yaw rad of the newest odometry, in hero_N/odom.
        true_pose (T, W, N, 3): the same in world, the ground truth.
        velocity (T, W, N, 2): linear m/s and angular rad/s of the newest odometry.
        command (T, W, N, 2): the velocity that the program sent last.
        range_m (T, W, N, 8): see Robot.proximity; only if the log was asked for ranges.
    """

    time_s: np.ndarray
    pose: np.ndarray
    true_pose: np.ndarray
    velocity: np.ndarray
    command: np.ndarray
    range_m: np.ndarray

    def __init__(self, rows: RobotRows, worlds: int, has_ranges: bool) -> None:
        """Begin empty."""
        self._rows = rows
        self._worlds = worlds
        self._has_ranges = has_ranges
        self._arrays: Dict[str, List[np.ndarray]] = {}

    def note(self) -> None:
        """Add a row: what is known now."""
        rows = self._rows
        now = {"pose": rows.odometry, "true_pose": rows.world.poses}
        now.update(velocity=rows.velocities, command=rows.commands)
        if self._has_ranges:
            now["range_m"] = rows.proximity_m
        for name, array in now.items():
            self._arrays.setdefault(name, []).append(array.reshape(self._worlds, -1, array.shape[1]).copy())
        self._arrays.setdefault("time_s", []).append(np.array(rows.now_ms / 1000.0))

    def __len__(self) -> int:
        return len(self._arrays.get("time_s", ()))

    def __getattr__(self, name: str) -> np.ndarray:
        if name.startswith("_") or name not in self._arrays:
            raise AttributeError("a log has time_s, pose, true_pose, velocity, command, and range_m on request")
        return np.array(self._arrays[name])
