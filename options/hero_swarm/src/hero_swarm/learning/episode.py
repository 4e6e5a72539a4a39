"""One world whose robots are driven by numbers from -1 to 1, with what they observe and are rewarded for. Pure."""

from typing import Optional

import numpy as np

from hero_client.values import BODY_RADIUS_M, MAX_LINEAR_M_S, Neighbors, sense_neighbors
from hero_driver.robot_constants import MAX_RIM_RANGE_M
from hero_sim.population import place_worlds
from hero_sim.stepped import RobotRows
from hero_sim.world import Arena, place_robots

from ..behavior import derive_seed
from ..metrics import FALLING
from ..metrics.own import State, measure_metric
from ..sources import Sources

MAX_LEARNED_ANGULAR_RAD_S = 4.0

_OWN = 14
"""Eight infrared ranges, two velocities, x, y, cosine and sine of the yaw."""


def count_observations(neighbors: int) -> int:
    """Return how many numbers a robot with this many neighbors observes."""
    return _OWN + 2 * neighbors


class Episode:
    """Robots in one arena from their start on; the same seed and actions give the same bytes on every machine.

    Attributes:
        time_s: since the start.
    """

    def __init__(
        self,
        robots: int,
        arena: Arena,
        seed: int,
        errors: float = 1.0,
        metric: Optional[str] = "dispersion_ratio",
        rate_hz: float = 10.0,
        neighbors: int = 5,
        range_m: float = 1.0,
    ) -> None:
        """Place robots by seed; errors: 0 for nominal robots, 1 for usual ones.

        metric: rewards are by how much it gets better in a step; None: no rewards. range_m: of neighbors, of
        which the nearest ones are observed.
        Raises: OptionError if the robots find no place.
        """
        starts = place_robots(arena, robots, np.random.RandomState(derive_seed(seed, "places")))[None]
        self.time_s = 0.0
        self._rows = RobotRows(place_worlds(arena, starts, [seed], errors))
        self._all = np.arange(robots)
        self._period_ms = round(1000.0 / rate_hz)
        self._sensor = Neighbors(range_m=range_m)
        self._neighbors = neighbors
        low_m, high_m = arena.bounds_m.reshape(2, 2)
        self._center_m, self._half_m = (low_m + high_m) / 2.0, (high_m - low_m) / 2.0
        self._metric, self._sources, self._arena = metric, Sources(), arena
        self._sign = -1.0 if metric in FALLING else 1.0
        self._poses = starts
        self._value = self._measure(starts)

    def step(self, actions: np.ndarray) -> np.ndarray:
        """Drive with actions (N, 2), shares of the largest linear and angular speed; return the rewards (N,)."""
        shares = np.clip(np.asarray(actions, dtype=float), -1.0, 1.0)
        self._rows.send_velocity(self._all, MAX_LINEAR_M_S * shares[:, 0], MAX_LEARNED_ANGULAR_RAD_S * shares[:, 1])
        self._rows.advance(self._rows.now_ms + self._period_ms)
        self.time_s = self._rows.now_ms / 1000.0
        value = self._measure(self._rows.world.poses[None].copy())
        reward, self._value = self._sign * (value - self._value), value
        return np.full(len(self._all), reward)

    def _measure(self, poses: np.ndarray) -> float:
        velocities = (poses - self._poses) * (1000.0 / self._period_ms)
        self._poses = poses
        if self._metric is None:
            return 0.0
        objects = self._rows.world.object_poses
        state = State(self._rows.now_ms / 1000.0, poses, velocities, objects, BODY_RADIUS_M, self._arena)
        return float(measure_metric(self._metric, state, self._sources)[0])

    def observe(self) -> np.ndarray:
        """Return what each robot observes, -1 to 1 (N, count_observations()).

        Infrared ranges, front first (0 touching, 1 nothing in range); linear and angular velocity as shares of the
        largest; place in the arena, -1 to 1 from side to side; cosine and sine of the yaw; then forward and
        left of the nearest neighbors as shares of their range, 0 for those that are missing.
        """
        poses = self._poses[0]
        rim_m = np.nan_to_num(self._rows.proximity_m, posinf=1e3) - BODY_RADIUS_M
        speeds = self._rows.velocities / (MAX_LINEAR_M_S, MAX_LEARNED_ANGULAR_RAD_S)
        places = (poses[:, :2] - self._center_m) / self._half_m
        headings = np.column_stack((np.cos(poses[:, 2]), np.sin(poses[:, 2])))
        seen = sense_neighbors(self._poses, self._sensor)
        nearest = np.where(seen.seen, seen.range_m, np.inf).argsort(axis=1, kind="stable")[:, : self._neighbors]
        others = np.zeros((len(poses), self._neighbors, 2))
        for column, values in enumerate((seen.forward_m, seen.left_m)):
            others[:, : nearest.shape[1], column] = np.take_along_axis(values, nearest, axis=1) / self._sensor.range_m
        columns = (rim_m / MAX_RIM_RANGE_M, speeds, places, headings, others.reshape(len(poses), -1))
        observed = np.clip(np.hstack(columns), -1.0, 1.0)
        observed[:, :8] = np.maximum(observed[:, :8], 0.0)
        return observed.astype(np.float32)
