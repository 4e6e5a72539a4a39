"""Worlds whose robots are driven by numbers from -1 to 1, with what they observe and are rewarded for. Pure."""

from typing import Any, Dict, Optional, Sequence, Union

import numpy as np

from hero_client.values import BODY_RADIUS_M, MAX_LINEAR_M_S, PlacedObjects
from hero_sim.population import place_worlds
from hero_sim.stepped import RobotRows
from hero_sim.world import Arena, place_robots

from ..behavior import Behavior, Random, derive_seed, sense
from ..metrics import FALLING
from ..metrics.own import State, measure_metric
from ..sources import Sources
from .observation import MAX_LEARNED_ANGULAR_RAD_S, Observation, count_observations

__all__ = ["MAX_LEARNED_ANGULAR_RAD_S", "Episode", "count_observations"]


class Episode:
    """Robots in one or more worlds from their start on; same seeds and actions give the same bytes on every machine.

    R robots are the rows of arrays, world after world.

    Attributes:
        time_s: since the start.
        observation: what robots observe.
    """

    def __init__(
        self,
        robots: int,
        arena: Arena,
        seed: Union[int, Sequence[int]],
        errors: float = 1.0,
        metric: Optional[str] = "dispersion_ratio",
        rate_hz: float = 10.0,
        neighbors: int = 5,
        range_m: float = 1.0,
        sensors: Optional[Dict[str, Any]] = None,
    ) -> None:
        """Place robots by the seed of each world; errors: 0 for nominal robots, 1 for usual ones.

        metric: built in, or FILE.py:FUNCTION; rewards are by how much it gets better in a step (an own one: rises);
        None: no rewards. range_m: of neighbors, of which the nearest ones are observed. sensors: others, by name.
        Raises: OptionError if the robots find no place.
        """
        seeds = [seed] if isinstance(seed, int) else list(seed)
        streams = (np.random.RandomState(derive_seed(one, "places")) for one in seeds)
        starts = np.array([place_robots(arena, robots, stream) for stream in streams])
        self.time_s = 0.0
        self.observation = Observation(tuple(arena.bounds_m.tolist()), neighbors, range_m, dict(sensors or {}))
        self._rows = RobotRows(place_worlds(arena, starts, seeds, errors))
        self._all = np.arange(starts.shape[0] * robots)
        self._period_ms = round(1000.0 / rate_hz)
        self._observer = type("Observer", (Behavior,), self.observation.list_sensors())()
        self._random = Random([derive_seed(one, "behavior") for one in seeds], robots)
        self._kept: Dict[str, Dict[str, Any]] = {}
        self._metric, self._sources, self._arena = metric, Sources(), arena
        self._radii_m = np.array([thing.shape.reach_m for thing in arena.objects])
        self._sign = -1.0 if metric in FALLING else 1.0
        self._poses = starts
        self._sense()
        self._value = self._measure(np.zeros_like(starts))

    def step(self, actions: np.ndarray) -> np.ndarray:
        """Drive with actions (R, 2), shares of the largest linear and angular speed; return the rewards (R,)."""
        shares = np.clip(np.asarray(actions, dtype=float), -1.0, 1.0)
        self._rows.send_velocity(self._all, MAX_LINEAR_M_S * shares[:, 0], MAX_LEARNED_ANGULAR_RAD_S * shares[:, 1])
        self._rows.advance(self._rows.now_ms + self._period_ms)
        self.time_s = self._rows.now_ms / 1000.0
        before, self._poses = self._poses, self._rows.world.poses.reshape(self._poses.shape).copy()
        self._sense()
        value = self._measure((self._poses - before) * (1000.0 / self._period_ms))
        reward, self._value = self._sign * (value - self._value), value
        return np.repeat(reward, self._poses.shape[1])

    def _sense(self) -> None:
        things = PlacedObjects(self._rows.world.object_poses, self._radii_m)
        around = {"arena": self._arena, "robots": self._rows, "kept": self._kept}
        self._sensed = sense(self._observer, self.time_s, self._poses, self._random, things, **around)

    def _measure(self, velocities: np.ndarray) -> np.ndarray:
        """Return the metric of each world (W,)."""
        if self._metric is None:
            return np.zeros(len(self._poses))
        measured = self._poses, velocities, self._rows.world.object_poses, BODY_RADIUS_M, self._arena
        return measure_metric(self._metric, State(self.time_s, *measured, self._sensed), self._sources)

    def observe(self) -> np.ndarray:
        """Return what each robot observes, -1 to 1 (R, K): see Observation."""
        return self.observation.read(self._sensed)
