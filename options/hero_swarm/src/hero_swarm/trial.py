"""Runs a behavior on stepped robots: many worlds at once, in virtual time. Pure."""

import math
from collections import deque
from typing import Any, Deque, Dict, Iterator, List, Optional, Sequence, Tuple

import numpy as np

from hero_client.values import BODY_RADIUS_M, PlacedObjects
from hero_node import Pose
from hero_sim.link import Radio, build_network, parse_wifi
from hero_sim.population import place_worlds
from hero_sim.stepped import RobotRows
from hero_sim.world import Arena, PushedBody, is_free, measure_clearance

from .behavior import PULSES, Behavior, Random, copy_poses, derive_seed, lock
from .control import Control
from .metrics.own import State
from .points import PointRows
from .safety import SafetyFilter
from .wheel_pulses import find_pulses, list_dead_zones

OPEN = Arena("open", np.empty((0, 4)), np.empty((0, 3)), (), np.array([-50.0, -50.0, 50.0, 50.0]))
"""A plane without walls."""

_MAX_TRIES = 20000

_ROUNDED_M = 1e-9
"""Robots may touch walls."""


def scatter(
    robots: int, width_m: float, height_m: float, seed: int, gap_m: float = 0.0, arena: Arena = OPEN
) -> np.ndarray:
    """Return poses (robots, 3) drawn uniformly in a rectangle around the origin, with gap_m between bodies.

    Inside the arena's bounds and clear of all that it holds. Raises: ValueError if they find no place.
    """
    random = np.random.RandomState(derive_seed(seed, "places"))
    half_m = np.array((width_m, height_m)) / 2.0 - BODY_RADIUS_M
    poses = np.empty((robots, 3))
    placed = 0
    for _ in range(0, _MAX_TRIES, robots):
        shares = 2.0 * random.random_sample((robots, 3)) - 1.0
        places_m = half_m * shares[:, :2]
        clear = is_clear(places_m, arena)
        for place_m, turn in zip(places_m[clear], shares[clear, 2]):
            if ((poses[:placed, :2] - place_m) ** 2).sum(axis=1).min(initial=np.inf) > (
                2.0 * BODY_RADIUS_M + gap_m
            ) ** 2:
                poses[placed] = (*place_m, math.pi * turn)
                placed += 1
                if placed == robots:
                    return poses
    raise ValueError("%d robots find no place in %g m x %g m of arena %s" % (robots, width_m, height_m, arena.name))


def is_clear(places_m: np.ndarray, arena: Arena, overlap_m: float = _ROUNDED_M) -> np.ndarray:
    """Return whether a robot at each of places_m (P, 2) is inside the arena's bounds and clear of all that it holds."""
    low_m, high_m = arena.bounds_m[:2] - _ROUNDED_M, arena.bounds_m[2:] + _ROUNDED_M
    radius_m = BODY_RADIUS_M - overlap_m
    clear: np.ndarray = ((places_m >= low_m) & (places_m <= high_m)).all(axis=1)
    clear &= measure_clearance(places_m, arena) >= radius_m
    if arena.objects:
        clear[clear] = [is_free(Pose(x_m, y_m, 0.0), (), arena, radius_m) for x_m, y_m in places_m[clear].tolist()]
    return clear


def scatter_objects(arena: Arena, robots: np.ndarray, seed: int) -> List[PushedBody]:
    """Return the arena's objects at places drawn from seed: inside its bounds, clear of all else and of robots (N, 3).

    Raises: ValueError if they find no place.
    """
    random = np.random.RandomState(derive_seed(seed, "objects"))
    low_m, high_m = arena.bounds_m[:2], arena.bounds_m[2:]
    placed: List[PushedBody] = []
    taken = [(x_m, y_m, BODY_RADIUS_M) for x_m, y_m in robots[:, :2].tolist()]
    for thing in arena.objects:
        reach_m = thing.shape.reach_m
        for _ in range(_MAX_TRIES):
            x_share, y_share, turn = random.random_sample(3)
            x_m, y_m = (low_m + (high_m - low_m) * (x_share, y_share)).tolist()
            free = measure_clearance(np.array([[x_m, y_m]]), arena)[0] > reach_m
            if free and all(math.hypot(x_m - x, y_m - y) > reach_m + radius_m for x, y, radius_m in taken):
                taken.append((x_m, y_m, reach_m))
                placed.append(thing.put(Pose(x_m, y_m, math.pi * (2.0 * turn - 1.0))))
                break
        else:
            raise ValueError(f"{len(arena.objects)} objects find no place in arena {arena.name}")
    return placed


class Trial:
    """One behavior on W worlds with N robots each.

    Attributes:
        rows: the robots, as arrays.
        poses: true poses (W, N, 3), read-only.
        velocities: how they changed in the last step of the behavior, per second (W, N, 3), read-only.
    """

    def __init__(
        self,
        behavior: Behavior,
        arena: Arena = OPEN,
        robots: int = 20,
        seeds: Sequence[int] = (0,),
        size_m: Optional[Tuple[float, float]] = None,
        errors: float = 1.0,
        delay_s: float = 0.0,
        filter_commands: Optional[SafetyFilter] = None,
        starts: Optional[np.ndarray] = None,
        objects: Optional[Sequence[Sequence[PushedBody]]] = None,
        known_errors: Sequence[str] = (),
        wifi: str = "ideal",
        is_point: bool = False,
    ) -> None:
        """Put robots at starts (W, N, 3), or scatter them over size_m, or over the arena. Each seed is one world.

        errors: 0 for nominal robots, 1 for usual ones. delay_s: age of the poses that robots sense each
        other by. filter_commands: keeps robots apart, or inside a fence, between the steps of the behavior as well;
        with it robots are slow where delay_s is more than 0.1 s, and do not move beyond 0.5 s.
        objects: of each world; None: those of the arena, where it has them. known_errors: of robots 0 to N - 1, as
        hero_sim --error takes them. wifi: quality of the network, as hero_sim --wifi.
        is_point: put points in place of robots (points.py).
        """
        x_min, y_min, x_max, y_max = arena.bounds_m
        width_m, height_m = (x_max - x_min, y_max - y_min) if size_m is None else size_m
        if starts is None:
            own = [arena.objects] * len(seeds) if objects is None else objects
            rooms = [arena._replace(objects=tuple(things)) for things in own]
            starts = np.array(
                [scatter(robots, width_m, height_m, seed, arena=room) for seed, room in zip(seeds, rooms)]
            )
        self.behavior = behavior
        radios: List[Radio] = []
        for seed in seeds if wifi != "ideal" else ():
            drawn = [derive_seed(seed, f"radio {robot}") for robot in range(robots)]
            radios += build_network(*parse_wifi(wifi), drawn)
        world = place_worlds(arena, starts, seeds, errors, objects, known_errors)
        self.rows: Any = PointRows(world) if is_point else RobotRows(world, radios)
        self._drives_by_pulses = behavior.drive == PULSES and not is_point
        self._dead_zones_us = list_dead_zones(self.rows.world.errors)
        self.poses, self.velocities = copy_poses(world.poses, starts.shape), lock(np.zeros_like(starts))
        random = Random([derive_seed(seed, "behavior") for seed in seeds], robots)
        self._control = Control(behavior, random, filter_commands, arena=arena, robots=self.rows)
        self._arena, self._decided_ms = arena, -1
        self._kept: Dict[str, Any] = {}
        self._delay_s, self._is_filtered = delay_s, filter_commands is not None
        self._seen: Deque[Tuple[float, np.ndarray]] = deque([(0.0, self.poses)])
        objects = [arena.objects] if objects is None else objects
        self._radii_m = np.array([thing.shape.reach_m for thing in objects[0]])
        self._all = np.arange(starts.shape[0] * robots)

    @property
    def memory(self) -> Any:
        """The memory of the behavior."""
        return self._control.memory

    @property
    def things(self) -> PlacedObjects:
        """The objects of all worlds, where they are now."""
        return PlacedObjects(self.rows.world.object_poses, self._radii_m)

    @property
    def state(self) -> State:
        """The state for metrics now; the behavior decides before, unless it has."""
        self._decide()
        control, radii_m = self._control, self.rows.world.errors.radius_m[: self.poses.shape[1], 0]
        of_behavior = control.sensed, control.memory, control.colors
        objects, time_s = lock(self.things.poses), self.rows.now_ms / 1000.0
        return State(time_s, self.poses, self.velocities, objects, lock(radii_m), self._arena, *of_behavior, self._kept)

    def _decide(self) -> None:
        """Send the commands of now, unless they were sent."""
        if self._decided_ms != self.rows.now_ms:
            self._decided_ms = self.rows.now_ms
            self._drive()

    def step(self) -> float:
        """Take one step of the behavior, let its time pass, and return the time (s)."""
        rows, start_ms, start = self.rows, self.rows.now_ms, self.poses
        for number in range(1, self._control.steps_per_decision + 1):
            self._decide()
            rows.advance(start_ms + round(number * 1000.0 / self._control.rate_hz))
            self.poses = copy_poses(rows.world.poses, start.shape)
        self.velocities = lock((self.poses - start) * self.behavior.rate_hz)
        return rows.now_ms / 1000.0

    def _drive(self) -> None:
        """Send the next commands, and the colors that were decided."""
        rows, now_s = self.rows, self.rows.now_ms / 1000.0
        self._seen.append((now_s, self.poses))
        while len(self._seen) > 1 and self._seen[1][0] <= now_s - self._delay_s + 1e-9:
            self._seen.popleft()
        seen_s, poses = self._seen[0]
        ages_s = np.full(poses.shape[:2], now_s - seen_s) if self._is_filtered else None
        linear_m_s, angular_rad_s = self._control.step(now_s, poses, self.things, ages_s)
        if self._drives_by_pulses:
            rows.send_pulses(self._all, *find_pulses(linear_m_s, angular_rad_s, self._dead_zones_us))
        else:
            rows.send_velocity(self._all, linear_m_s, angular_rad_s)
        colors = self._control.colors if self._control.has_decided else None
        if colors is not None:
            rows.send_light(self._all, np.column_stack((colors, np.ones(len(colors)))))

    def run(self, time_s: float, every_s: float = 1.0) -> Iterator[Tuple[float, np.ndarray]]:
        """Yield the time (s) and the poses (W, N, 3) every so often, for this long."""
        now_s = due_s = 0.0
        while now_s < time_s - 1e-9:
            if now_s >= due_s - 1e-9:
                due_s += every_s
                yield now_s, self.poses
            now_s = self.step()
