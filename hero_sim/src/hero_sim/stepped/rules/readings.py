"""The newest readings of all robots, on the robots or as their programs have received them. Pure."""

from typing import Collection

import numpy as np

from ...robot.clock import LONG_AGO_MS

WHEELS, SCAN, DISTANCE = "wheels", "scan", "distance"
"""Parts that are read and sent at different times."""


class Readings:
    """Odometry and scans; RobotRows says what they mean.

    Attributes:
        odometry (R, 3), velocities (R, 2), ticks (R, 2), odometry_ms (R,): of the wheels.
        counts, ranges_m, proximity_m (R, 8), scan_ms (R,): of the infrared sensors.
        distance_m, distance_ms (R,): of the distance sensor, nan without.
    """

    def __init__(self, rows: int) -> None:
        """Begin with zeros."""
        self.odometry = np.zeros((3, rows)).T
        self.velocities, self.ticks = np.zeros((2, rows)).T, np.zeros((2, rows)).T
        self.counts, self.ranges_m, self.proximity_m = np.zeros((3, rows, 8))
        self.odometry_ms, self.scan_ms = np.zeros((2, rows), dtype=np.int64)
        self.distance_ms = np.full(rows, LONG_AGO_MS)
        self.distance_m = np.full(rows, np.nan)

    def receive(self, sent: "Readings", rows: np.ndarray, now_ms: int, parts: Collection[str]) -> None:
        """Take what the robots at rows (K,) sent."""
        if WHEELS in parts:
            self.odometry[rows], self.velocities[rows] = sent.odometry[rows], sent.velocities[rows]
            self.ticks[rows], self.odometry_ms[rows] = sent.ticks[rows], now_ms
        if SCAN in parts:
            self.counts[rows], self.ranges_m[rows] = sent.counts[rows], sent.ranges_m[rows]
            self.proximity_m[rows], self.scan_ms[rows] = sent.proximity_m[rows], now_ms
        if DISTANCE in parts:
            self.distance_m[rows], self.distance_ms[rows] = sent.distance_m[rows], now_ms
