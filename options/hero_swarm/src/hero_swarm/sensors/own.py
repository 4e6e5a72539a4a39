"""Sensors of the robots themselves, the same on stepped robots, behind sockets and on real ones. Pure."""

from typing import NamedTuple

import numpy as np

from . import Surroundings


class Infrared(NamedTuple):
    """Readings of the eight infrared sensors, front first, counter-clockwise (R, 8).

    Attributes:
        ranges_m: from the robot's center; inf nothing in range, 0 too close, nan not calibrated or not known.
        counts: without ambient light; the nearer and brighter, the more.
    """

    ranges_m: np.ndarray
    counts: np.ndarray


class Proximity(NamedTuple):
    """The eight infrared sensors; gives an Infrared."""

    def read(self, around: Surroundings) -> Infrared:
        """Return the newest readings."""
        counts = np.asarray(around.robots.counts, dtype=float)  # rear first
        return Infrared(around.robots.proximity_m.copy(), np.roll(counts, counts.shape[1] // 2, axis=1))


class Distance(NamedTuple):
    """The sensor ahead of HeRo+, m from the robot's center (R,); nan for robots without it."""

    def read(self, around: Surroundings) -> np.ndarray:
        """Return the newest distances."""
        return np.array(around.robots.distance_m, dtype=float)


class OwnMotion(NamedTuple):
    """Odometry: poses x m, y m, yaw rad (R, 3), each in its robot's own frame, and speeds (R,); nan: not known."""

    poses: np.ndarray
    linear_m_s: np.ndarray
    angular_rad_s: np.ndarray


class Odometry(NamedTuple):
    """Odometry by the ticks of the wheels; gives an OwnMotion."""

    def read(self, around: Surroundings) -> OwnMotion:
        """Return the newest odometry."""
        linear_m_s, angular_rad_s = np.array(around.robots.velocities, dtype=float).T
        return OwnMotion(np.array(around.robots.odometry, dtype=float), linear_m_s, angular_rad_s)


class NeighborColors(NamedTuple):
    """Colors that robots of the same world show, red green blue from 0 to 1 (R, N, 3); 0 for dark ones.

    Columns are those of Neighbors, whose `seen` says which are in sight.
    """

    def read(self, around: Surroundings) -> np.ndarray:
        """Return the colors of the last step."""
        worlds, robots, _ = around.poses.shape
        colors = np.zeros((worlds * robots, 3)) if around.colors is None else np.asarray(around.colors, dtype=float)
        return np.repeat(colors.reshape(worlds, 1, robots, 3), robots, axis=1).reshape(-1, robots, 3)
