"""Observation of each robot as numbers from -1 to 1, the same in environments and in a policy. Pure."""

from typing import Any, Dict, NamedTuple, Tuple

import numpy as np

from hero_client.values import BODY_RADIUS_M, MAX_LINEAR_M_S, Neighbors
from hero_node.robot_constants import MAX_RIM_RANGE_M

from ..behavior import Odometry, Proximity, Sensed

MAX_LEARNED_ANGULAR_RAD_S = 4.0

_OWN = 14
"""Eight infrared ranges, two velocities, x, y, cosine and sine of the yaw."""


def count_observations(neighbors: int) -> int:
    """Return how many numbers a robot with this many neighbors, and no other sensors, observes."""
    return _OWN + 2 * neighbors


class Observation(NamedTuple):
    """Which sensors are observed.

    Attributes:
        bounds_m: x min, y min, x max, y max of the arena.
        neighbors: number of nearest neighbors.
        range_m: of neighbors.
        sensors: others by their names, as a behavior has them.
    """

    bounds_m: Tuple[float, ...]
    neighbors: int = 5
    range_m: float = 1.0
    sensors: Dict[str, Any] = {}

    def list_sensors(self) -> Dict[str, Any]:
        """Return all sensors of a behavior that observes this, by their names."""
        return {"near": Neighbors(range_m=self.range_m), "eyes": Proximity(), "wheels": Odometry(), **self.sensors}

    def read(self, sensed: Sensed) -> np.ndarray:
        """Return what each robot observes (R, K).

        Infrared ranges, front first (0 touching, 1 nothing in range); linear and angular velocity as shares of the
        largest; place in the arena, -1 to 1 from side to side; cosine and sine of the yaw; then forward and
        left of the nearest neighbors as shares of their range, 0 for those that are missing; then the arrays of
        other sensors, but whole numbers, in the order of their names.
        """
        x_m, y_m, yaw_rad = sensed.poses.T
        rim_m = np.nan_to_num(sensed.eyes.ranges_m, posinf=1e3) - BODY_RADIUS_M
        speeds = sensed.wheels.linear_m_s / MAX_LINEAR_M_S, sensed.wheels.angular_rad_s / MAX_LEARNED_ANGULAR_RAD_S
        low_m, high_m = np.reshape(self.bounds_m, (2, 2))
        places = (sensed.poses[:, :2] - (low_m + high_m) / 2.0) / ((high_m - low_m) / 2.0)
        own = np.column_stack((*speeds, places, np.cos(yaw_rad), np.sin(yaw_rad)))
        near = sensed.near
        nearest = np.where(near.seen, near.range_m, np.inf).argsort(axis=1, kind="stable")[:, : self.neighbors]
        others = np.zeros((len(x_m), self.neighbors, 2))
        for column, values in enumerate((near.forward_m, near.left_m)):
            others[:, : nearest.shape[1], column] = np.take_along_axis(values, nearest, axis=1) / self.range_m
        rays = np.maximum(rim_m / MAX_RIM_RANGE_M, 0.0)
        columns = [rays, own, others.reshape(len(x_m), -1)]
        for name in sorted(self.sensors):
            reading = getattr(sensed, name)
            for array in reading if isinstance(reading, tuple) else (reading,):
                if array.dtype.kind in "bf" and array.shape[:1] == x_m.shape:
                    columns.append(array.reshape(len(x_m), -1).astype(float))
        return np.clip(np.nan_to_num(np.hstack(columns), posinf=1.0, neginf=-1.0), -1.0, 1.0).astype(np.float32)
