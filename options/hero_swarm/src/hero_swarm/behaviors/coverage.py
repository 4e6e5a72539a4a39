"""Voronoi coverage of an arena."""

from typing import Any

import numpy as np

from hero_client.controllers import steer
from hero_node.parameters import number

from ..behavior import SPEED, Behavior, Command, Random, Sensed, turn


class VoronoiCoverage(Behavior):
    """Each robot drives to the middle of the points that are nearer to it than to any other (Lloyd's algorithm).

    Source: J. Cortes et al., Coverage control for mobile sensing networks, IEEE TRA 2004. The arena is a rectangle
    around the origin of the common frame. Robots need their poses in it, not only those of their neighbors.
    """

    metric = "nearest_neighbor"
    width_m, height_m = 2.0, 2.0
    cell_m = 0.05
    gain_1_s = 0.5
    rate_hz = 5.0
    max_linear_m_s = 0.1
    settings = {**dict.fromkeys(("width_m", "height_m"), number(2.0, 0.2, 20.0, "m")), "max_linear_m_s": SPEED}

    def step(self, sensed: Sensed, memory: Any, random: Random) -> Command:
        poses = sensed.poses.reshape(-1, sensed.count, 3)
        x_m = np.arange((self.cell_m - self.width_m) / 2.0, self.width_m / 2.0, self.cell_m)
        y_m = np.arange((self.cell_m - self.height_m) / 2.0, self.height_m / 2.0, self.cell_m)
        points_m = np.array(np.meshgrid(x_m, y_m)).reshape(2, -1)
        targets_m = np.empty((*poses.shape[:2], 2))
        for world_m, places_m in zip(targets_m, poses[..., :2]):
            off_m2 = ((points_m[:, None] - places_m.T[..., None]) ** 2).sum(axis=0)
            owner = np.where(np.isfinite(off_m2), off_m2, np.inf).argmin(axis=0)
            counts = np.bincount(owner, minlength=sensed.count)
            for axis in (0, 1):
                sums_m = np.bincount(owner, points_m[axis], sensed.count)
                world_m[:, axis] = np.where(counts > 0, sums_m / np.maximum(counts, 1), places_m[:, axis])
        to_m = np.nan_to_num((targets_m - poses[..., :2]).reshape(-1, 2)) * self.gain_1_s
        forward_m_s, left_m_s = turn(to_m.T, -np.nan_to_num(sensed.poses[:, 2]))
        return (*steer(forward_m_s, left_m_s, self.max_linear_m_s), memory)
