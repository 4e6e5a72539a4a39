"""Many worlds at once as one environment of plain arrays, for policies that all robots share. Pure: numpy only."""

from typing import Any, Dict, Optional, Tuple, Union

import numpy as np

from hero_client.values import BODY_RADIUS_M, MAX_LINEAR_M_S, PlacedObjects
from hero_sim.population import place_worlds
from hero_sim.stepped import RobotRows
from hero_sim.world import Arena, build_default, load_arena, place_robots

from ..behavior import Behavior, Random, copy_poses, derive_seed, sense
from ..metrics import FALLING
from ..metrics.own import State, measure_metric
from ..sources import Sources
from .observation import MAX_LEARNED_ANGULAR_RAD_S, Observation


class SwarmVectorEnv:
    """W worlds with N robots each, the R rows of all arrays, world after world; all end after time_s.

    Same seeds and actions give the same bytes on every machine.

    Attributes:
        worlds, robots: how many, W and N.
        observation: what robots observe; needed to save a policy.
        time_s: since the worlds began.
        ended: whether the time is over: call reset().
    """

    def __init__(
        self,
        worlds: int = 16,
        robots: int = 10,
        arena: Union[str, Arena] = "",
        time_s: float = 60.0,
        errors: float = 1.0,
        metric: Optional[str] = "dispersion_ratio",
        rate_hz: float = 10.0,
        neighbors: int = 5,
        range_m: float = 1.0,
        sensors: Optional[Dict[str, Any]] = None,
    ) -> None:
        """arena: one, or its name or file in the simulator; empty: a square that fits the robots.

        errors: 0 for nominal robots, 1 for usual ones. metric: built in, or FILE.py:FUNCTION; rewards are by how much
        it gets better in a step (an own one: rises); None: no rewards. range_m: of neighbors, of which the nearest ones
        are observed. sensors: others, by name.
        """
        self.worlds, self.robots = worlds, robots
        if isinstance(arena, str):
            arena = load_arena(arena) if arena else build_default(robots)
        self._arena, self._errors, self._end_s, self._period_ms = arena, errors, time_s, round(1000.0 / rate_hz)
        self.observation = Observation(tuple(arena.bounds_m.tolist()), neighbors, range_m, dict(sensors or {}))
        self._observer = type("Observer", (Behavior,), self.observation.list_sensors())()
        self._metric, self._sources = metric, Sources()
        self._sign = -1.0 if metric in FALLING else 1.0
        self._radii_m = np.array([thing.shape.reach_m for thing in arena.objects])
        self._seed, self.time_s, self.ended = 0, 0.0, True

    def reset(self, seed: Optional[int] = None) -> np.ndarray:
        """Begin worlds of this seed and those after it, without one of the next seeds; return observations (R, K).

        Raises: OptionError if the robots find no place.
        """
        first = self._seed if seed is None else seed
        self._seed, self.time_s, self.ended = first + self.worlds, 0.0, False
        seeds = range(first, self._seed)
        streams = (np.random.RandomState(derive_seed(one, "places")) for one in seeds)
        places = np.array([place_robots(self._arena, self.robots, stream) for stream in streams])
        self._rows = RobotRows(place_worlds(self._arena, places, seeds, self._errors))
        self._poses = copy_poses(self._rows.world.poses, places.shape)
        self._random = Random([derive_seed(one, "behavior") for one in seeds], self.robots)
        self._kept: Dict[str, Dict[str, Any]] = {}
        observed = self._observe()
        self._value = self._measure(np.zeros_like(self._poses))
        return observed

    def step(self, actions: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Drive for one period with actions (R, 2), shares of the largest linear and angular speed, -1 to 1.

        Returns observations (R, K): see Observation; and rewards (R,).
        """
        rows, shares = self._rows, np.clip(np.asarray(actions, dtype=float), -1.0, 1.0)
        every = np.arange(len(shares))
        rows.send_velocity(every, MAX_LINEAR_M_S * shares[:, 0], MAX_LEARNED_ANGULAR_RAD_S * shares[:, 1])
        rows.advance(rows.now_ms + self._period_ms)
        self.time_s = rows.now_ms / 1000.0
        self.ended = self.time_s >= self._end_s - 1e-6
        before, self._poses = self._poses, copy_poses(rows.world.poses, self._poses.shape)
        observed = self._observe()
        value = self._measure((self._poses - before) * (1000.0 / self._period_ms))
        reward, self._value = self._sign * (value - self._value), value
        return observed, np.repeat(reward, self.robots)

    def _observe(self) -> np.ndarray:
        things = PlacedObjects(self._rows.world.object_poses, self._radii_m)
        around = {"arena": self._arena, "robots": self._rows, "kept": self._kept}
        self._sensed = sense(self._observer, self.time_s, self._poses, self._random, things, **around)
        return self.observation.read(self._sensed)

    def _measure(self, velocities: np.ndarray) -> np.ndarray:
        """Return the metric of each world (W,)."""
        if self._metric is None:
            return np.zeros(self.worlds)
        measured = self._poses, velocities, self._rows.world.object_poses, BODY_RADIUS_M, self._arena
        return measure_metric(self._metric, State(self.time_s, *measured, self._sensed), self._sources)
