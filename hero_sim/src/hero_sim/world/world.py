"""The physics of all robots: servos, wheel travel, poses and collisions, one fixed step at a time.

Pure: numpy only. Everything is an array over robots: one row for each, world after world, all in one arena and with
the same number of robots in each world. The robots' bodies set servo pulses and read the wheels; nothing here knows
about messages. A world gives the same bytes alone, in any place of a batch, and on any machine: a step uses
only operations that IEEE 754 defines to the last bit, and random numbers that are made of whole ones.
"""

import copy
from typing import Any, Iterator, List, NamedTuple, Optional, Sequence, Tuple, Union

import numpy as np

from hero_node.robot_constants import BEAMS

from . import wheel_loops
from .arena import Arena, Segments
from .compiled import compile_loops
from .contacts import Contacts
from .kinematics import join_wheels
from .pushing.pushing import Pushing
from .pushing.shapes import PushedBody, list_outlines
from .range_sensors import DISTANCE_NOISE_M, DISTANCE_REACH_M, NOISE_COUNTS, Sight, measure_distances, measure_signals
from .robot_errors import MAX_WHEEL_M_S, SERVO_GAIN_M_S_US, RobotErrors
from .wheel_loops import draw_normal_at, drive_wheel, find_place

STEP_MS = 10
"""Length of a physics step; the fastest robot moves 3 mm in it, far less than its radius."""

_STEP_S = STEP_MS / 1000.0

_BLOCK_STEPS = 32
"""Steps that bodies follow their wheels at once; without compiled loops, random numbers are drawn for as many."""

_CACHED = 8192
"""Random numbers that are computed at once: they fit the processor's cache."""

_FRAME_STEPS = 2
"""Steps that bodies take at once, in worlds without objects: solving contacts takes the most time of all."""

_SCAN_ROWS = 20
"""Robots whose sensors are computed at once without compiled loops: what they see fits the processor's cache."""

_REST_M_S = 1e-6

Rows = Union[int, slice, np.ndarray]  # the number of one row, or several of them

Obstacles = Tuple[Segments, np.ndarray]
"""Walls, and circles (C, 3), x y radius, of one world."""


class View(NamedTuple):
    """The bodies at one time, for sensors that are read later.

    Attributes:
        number: which view of the world it is; the noise of its readings depends on it alone.
        places_m, headings: x and y, cosine and sine of all robots (R, 2).
        obstacles: of each world with objects; empty if the arena has none.
    """

    number: int
    places_m: np.ndarray
    headings: np.ndarray
    obstacles: List[Obstacles]


def drive_servos(
    pulses_us: Any,
    centers_us: Any,
    dead_zones_us: Any,
    gains_m_s_us: Any,
    least: Any = np.minimum,
    most: Any = np.maximum,
) -> Any:
    """Return the wheel speeds (m/s) that pulses stand for: arrays, or with Python's min and max single numbers."""
    beyond_us = pulses_us - centers_us
    driven_us = beyond_us - least(most(beyond_us, -dead_zones_us), dead_zones_us)
    return least(most(driven_us * gains_m_s_us, -MAX_WHEEL_M_S), MAX_WHEEL_M_S)


class World:
    """All robots in one arena, or in several worlds with the same arena.

    Attributes:
        arena: walls and obstacles of each world.
        worlds: how many there are.
        time_ms: end of the last step.
        errors: differences of each robot from the nominal one; constant.
        commands_m_s: the servos' commands (R, 2), as the wheel speeds they stand for, left and right.
        servo_gains_m_s_us: of the servos (R, 2), with their directions; constant.
        speeds_m_s, travels_m: of the wheels (R, 2).
    """

    def __init__(
        self,
        arena: Arena,
        poses: np.ndarray,
        rngs: Sequence[np.random.RandomState],
        errors: RobotErrors,
        objects: Optional[Sequence[Sequence[PushedBody]]] = None,
    ) -> None:
        """Place robots at poses (R, 3); slip, ripple and sensor noise of each world are drawn from one of rngs.

        objects: of each world, where they are in it; None: those of the arena.
        """
        # Inside, quantities come first and robots last: whole rows of memory are computed with.
        rows = len(poses)
        self.arena = arena
        self.worlds = len(rngs)
        self._robots = rows // self.worlds  # of each
        self.time_ms = 0
        self.errors = errors
        self._views = 0
        self._motion_keys, self._scan_keys = (
            np.array([rng.randint(0, 2**63 - 1, dtype=np.int64) for rng in rngs]).astype(np.uint64) for _ in range(2)
        )
        objects = [arena.objects] * self.worlds if objects is None else objects
        self._separations_m, radii_m = errors.wheel_separation_m[:, 0], errors.radius_m[:, 0]
        obstacles = arena.segments_m.tolist(), arena.circles_m.tolist()
        of_robots = radii_m.reshape(self.worlds, -1).tolist(), errors.friction[:, 1].reshape(self.worlds, -1).tolist()
        self._pushing = [
            Pushing([thing.put(thing.pose) for thing in things], *obstacles, *own) if things else None
            for things, *own in zip(objects, *of_robots)
        ]
        self._frame_steps = 1 if any(self._pushing) else _FRAME_STEPS
        places = np.array(poses, dtype=float).reshape(rows, 3).T
        self._contacts = Contacts(arena, places, self.worlds, errors, _STEP_S * self._frame_steps, self._pushing)
        self._shown = self._contacts.states.copy()
        self._shown_poses = self._shown[:3].T
        self._shown_poses.flags.writeable = False
        self._commands = np.zeros((2, rows))
        self._wheels = np.zeros((4, rows))
        self._travels, self._speeds = self._wheels[:2], self._wheels[2:]
        self._wheel_rows: Optional[List[List[float]]] = None
        self.commands_m_s = self._commands.T
        self.travels_m, self.speeds_m_s = self._travels.T, self._speeds.T
        # Below its center the left wheel rolls forward.
        self.servo_gains_m_s_us = np.asfortranarray(errors.servo_gain * (-SERVO_GAIN_M_S_US, SERVO_GAIN_M_S_US))
        servos = errors.servo_center_us, errors.dead_zone_us, self.servo_gains_m_s_us
        self._servos = [np.ascontiguousarray(values.T) for values in servos]
        # The share of the difference to its command by which a servo's speed changes in one step.
        shares = -np.expm1(-_STEP_S / errors.servo_lag_s.T).astype(np.float32).astype(float)
        each = errors.ripple_m_s.T, errors.slip.T, errors.wheel_scale.T * _STEP_S, shares
        self._spreads = np.vstack([np.broadcast_to(values, (2, rows)) for values in each])  # see roll_wheels()
        self._loops = compile_loops(wheel_loops, rows)
        # Of the steps in a block, those that the wheels have taken, and the bodies: these wait until they are read, and
        # are then shown after the wheels' last step.
        self._block_step = self._body_step = self._shown_step = _BLOCK_STEPS
        self._ground_m = np.empty((_BLOCK_STEPS, 2, rows))
        self._walls = Segments.from_ends(arena.segments_m)
        if self._loops is not None:
            self.read_infrared(np.arange(rows))  # loads what is compiled now: robots in real time would pause
            self._views = 0

    @property
    def poses(self) -> np.ndarray:
        """True poses at time_ms (R, 3), read only: x m, y m, theta rad, frame world. Read again after each step."""
        self._move_bodies()
        return self._shown_poses

    @property
    def wheel_rows(self) -> List[List[float]]:
        """Travels and speeds of each robot's wheels as lists: single reads are much faster than from arrays."""
        if self._wheel_rows is None:
            self._wheel_rows = self._wheels.T.tolist()
        return self._wheel_rows

    def write_pulses(self, which: Union[bool, np.ndarray], pulses_us: np.ndarray) -> None:
        """Set the servos' pulses, left and right (2, R), of the robots which: a mask (R,), or True for all."""
        np.copyto(self._commands, drive_servos(pulses_us, *self._servos), where=which)

    def release(self, rows: Rows) -> None:
        """Stop the pulses of rows: their wheels come to rest."""
        self.commands_m_s[rows] = 0.0

    def step(self, count: int = 1) -> None:
        """Move everything on by STEP_MS, or by count times that."""
        while count > 0:
            if self._block_step == _BLOCK_STEPS:
                self._begin_block()
            first, end = self._block_step, min(self._block_step + count, _BLOCK_STEPS)
            self._roll_wheels(self._ground_m[first:end], first)
            self._wheel_rows = None
            self._block_step = end
            self.time_ms += STEP_MS * (end - first)
            count -= end - first

    def _begin_block(self) -> None:
        """End the motion of wheels that hardly move, and draw what chance does in the next steps."""
        self._move_bodies()
        self._block_step = self._body_step = self._shown_step = 0
        self._speeds[np.abs(self._speeds) < _REST_M_S] = 0.0
        if self._loops is None:
            noise = _draw_block(self._motion_keys, self.time_ms // STEP_MS, self._robots)
            self._ripples_m_s = noise[:, :2] * self._spreads[:2]
            # Distance of a wheel's body over the ground for each m/s.
            self._ground_s = (1.0 - np.abs(noise[:, 2:]) * self._spreads[2:4]) * self._spreads[4:6]

    def _roll_wheels(self, ground_m: np.ndarray, step: int) -> None:
        """Take K steps of the wheels, the first of which is a step of the block; ground_m (K, 2, R): their ways."""
        if self._loops is not None:
            first_step = self.time_ms // STEP_MS
            self._loops.roll_wheels(
                self._motion_keys, first_step, self._wheels, self._commands, self._spreads, ground_m, _STEP_S
            )
            return
        speeds_m_s, shares = self._speeds, self._spreads[6:]
        for rolled_m, ground_s, ripples_m_s in zip(ground_m, self._ground_s[step:], self._ripples_m_s[step:]):
            # Travel is taken with the speed of the step's start, so that reads within the step meet its end.
            self._travels += speeds_m_s * _STEP_S
            np.multiply(speeds_m_s, ground_s, out=rolled_m)
            speeds_m_s[:] = drive_wheel(speeds_m_s, self._commands, ripples_m_s, shares)

    def _move_bodies(self) -> None:
        """Move the bodies by the wheels' steps, a frame of steps at a time; within a frame they are shown half-way.

        They are the same whenever they are read: the way of a wheel is known when its step begins.
        """
        step, frame_steps = self._block_step, self._frame_steps
        if step == self._shown_step:
            return
        self._shown_step = step
        end = step + step % frame_steps
        if end > step:
            wheels = self._wheels.copy()
            self._roll_wheels(self._ground_m[step:end], step)
            self._wheels[:] = wheels
        steps_m = self._ground_m[self._body_step : end]
        ground_m = sum((steps_m[part::frame_steps] for part in range(frame_steps)), np.zeros(()))
        self._body_step = end
        if end == step:
            self._contacts.move(ground_m)
            self._shown[:] = self._contacts.states
            return
        self._contacts.move(ground_m[:-1])
        self._shown[:] = self._contacts.states
        self._contacts.move(ground_m[-1:])
        self._shown += self._contacts.states
        self._shown[:3] /= 2.0
        self._shown[3:] /= np.sqrt(self._shown[3] * self._shown[3] + self._shown[4] * self._shown[4])

    def measure_overlaps(self) -> Tuple[np.ndarray, np.ndarray]:
        """Return how deep (m) each robot is in another robot at most (R,), and in a wall or obstacle (R,)."""
        self._move_bodies()
        return self._contacts.measure_overlaps()

    def measure_body_speeds(self) -> np.ndarray:
        """Return linear (m/s) and angular speed (rad/s) of each robot (R, 2), as its wheels have it."""
        left_m_s, right_m_s = self._speeds
        return np.column_stack(join_wheels(left_m_s, right_m_s, self._separations_m))

    def observe(self) -> View:
        """Return where all bodies are now."""
        self._views += 1
        places_m = self.poses[:, :2].copy()
        obstacles = [self._list_obstacles(pushing) for pushing in self._pushing if pushing]
        return View(self._views, places_m, self._shown[3:].T.copy(), obstacles)

    def _list_obstacles(self, pushing: Pushing) -> Obstacles:
        """Return the walls and the circles of a world, with its objects where they are now."""
        edges_m, discs_m = list_outlines(pushing.bodies)
        walls_m = np.vstack((self.arena.segments_m, np.reshape(edges_m, (-1, 4))))
        return Segments.from_ends(walls_m), np.vstack((self.arena.circles_m, np.reshape(discs_m, (-1, 3))))

    @property
    def object_poses(self) -> np.ndarray:
        """True poses of the objects at time_ms (W, M, 3), as of robots; each world has as many."""
        self._move_bodies()
        worlds = [[pushed.pose for pushed in pushing.bodies] for pushing in self._pushing if pushing]
        return np.array(worlds, dtype=float).reshape(self.worlds, -1, 3) if worlds else np.empty((self.worlds, 0, 3))

    def list_objects(self) -> List[PushedBody]:
        """Return copies of the objects of the first world, where they are at time_ms."""
        self._move_bodies()
        return [copy.copy(pushed) for pushing in self._pushing[:1] if pushing for pushed in pushing.bodies]

    def read_infrared(self, which: np.ndarray, view: Optional[View] = None) -> np.ndarray:
        """Return one noisy reading (whole counts, 0..1023) of the eight sensors of the robots which, (K, 8).

        which (K,): rows in ascending order, at least one. view: when it was taken; None for now.
        """
        view = self.observe() if view is None else view
        alpha_counts_m2, beta_counts = self.errors.alpha_counts_m2, self.errors.beta_counts
        looks = self._look(which, view)
        seen = [measure_signals(sight, alpha_counts_m2[rows], beta_counts[rows]) for rows, sight in looks]
        counts_read = np.rint(np.concatenate(seen) + self._draw_noise(which, view) * NOISE_COUNTS)
        # Adding zero turns -0.0 into 0.0, whose inverse is the right infinity.
        return np.minimum(np.maximum(counts_read, 0.0), 1023.0) + 0.0

    def read_distances(self, which: np.ndarray, view: Optional[View] = None) -> np.ndarray:
        """Return one noisy reading (m) of a sensor that looks ahead from the middle of the robots which, (K,).

        which, view: as for read_infrared().
        """
        view = self.observe() if view is None else view
        seen_m = np.concatenate([measure_distances(sight) for _, sight in self._look(which, view)])
        read_m = np.round(seen_m + self._draw_noise(which, view)[:, 0] * DISTANCE_NOISE_M, 3)
        return np.minimum(np.maximum(read_m, 0.001), DISTANCE_REACH_M)

    def _draw_noise(self, which: np.ndarray, view: View) -> np.ndarray:
        """Return the noise of a view (K, 8), each world's for its own robots: motion is the same if it is not read."""
        places = find_place(2 * view.number, np.arange(BEAMS), (which % self._robots)[:, None])
        noise: np.ndarray = draw_normal_at(self._scan_keys[which // self._robots][:, None], places)
        return noise

    def _look(self, which: np.ndarray, view: View) -> Iterator[Tuple[np.ndarray, Sight]]:
        """Yield rows that see the same obstacles, a few at a time, with what they may see."""
        worlds = which // self._robots
        starts = (worlds[1:] != worlds[:-1]).nonzero()[0] + 1 if view.obstacles else ()
        for first, end in zip([0, *starts], [*starts, len(which)]):
            obstacles = view.obstacles[worlds[first]] if view.obstacles else (self._walls, self.arena.circles_m)
            at_once = _SCAN_ROWS if self._loops is None else end - first
            for start in range(first, end, at_once):
                rows = which[start : min(start + at_once, end)]
                bodies_m = view.places_m.reshape(self.worlds, self._robots, 2)[rows // self._robots]
                radii_m = self.errors.radius_m[: self._robots, 0]
                yield rows, Sight(view.places_m[rows], view.headings[rows], bodies_m, radii_m, *obstacles)


def _draw_block(keys: np.ndarray, first_step: int, robots: int) -> np.ndarray:
    """Return the random numbers of a block of steps (K, 4, R), from the streams of worlds with so many robots each."""
    drawn = np.empty((_BLOCK_STEPS, 4, len(keys), robots))
    own = find_place(0, np.arange(4).reshape(-1, 1, 1), np.arange(robots))
    at_once = max(1, _CACHED // drawn[0].size)
    for begin in range(0, _BLOCK_STEPS, at_once):
        steps = np.arange(first_step + begin, first_step + min(begin + at_once, _BLOCK_STEPS))
        drawn[begin : begin + at_once] = draw_normal_at(
            keys[:, None], own + find_place(steps, 0, 0).reshape(-1, 1, 1, 1)
        )
    return drawn.reshape(_BLOCK_STEPS, 4, -1)
