"""Moves the bodies of all worlds by their wheels, and keeps them apart: robots, walls, obstacles and things.

Pure: numpy only; robots of different worlds never meet. What a contact does is up to body_loops.py; here bodies that
are near each other are listed, and looked at only when they could touch. What happens does not depend on when they are
looked at, nor on whether the loops over worlds are compiled.
"""

import math
from typing import Any, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from . import body_loops
from .arena import Arena, list_obstacles, measure_clearance, square_length
from .body_loops import (
    BODY_ROWS,
    CASTER_N,
    CONTACT_ROWS,
    COSINE,
    CREEP,
    FRICTION,
    GAP,
    GIVE,
    GRAVITY_M_S2,
    HALF,
    KEPT_ROWS,
    LEFT,
    LEVER_1,
    LEVER_2,
    MOVED_X,
    MOVING_ROWS,
    ON_ROBOT,
    ON_WALL,
    PRESSURE,
    RADIUS,
    SHARE,
    SHIFT_M,
    SINE,
    STEP_X,
    THING_CREEP_M_S,
    TOUCH_M,
    TOUCHING,
    TURN,
    TURNED,
    WHEEL_N,
    X,
    follow_arc,
    shape_arc,
)  # fmt: skip
from .compiled import compile_loops
from .kinematics import find_heading, join_wheels
from .pushing.pushing import Pushing, Touch
from .pushing.shapes import PushedBody
from .robot_errors import RobotErrors

_MARGIN_M = 0.03
"""Distance that bodies may move until their neighbors are listed again; a larger margin makes each step slower."""

_MANY = 12
"""Contacts of a robot for which there is room at the start."""

_OF_PLACE = np.dtype([("first", np.uintp), ("second", np.uintp), ("starts", int), ("seen", int)])
_OF_BODY = np.dtype([("stamp", int), *((name, float) for name in ("x", "y", "turn", "a", "u_x", "u_y", "h"))])
_ENDS = [f"{how}_{part}_{end}" for end in (1, 2) for how in ("pressed", "dragged") for part in ("x", "y", "turn")]
_FOUND = "normal_x normal_y gap slide arm_1 lever_1 arm_2 lever_2 friction share pressure drag give".split()
_OF_PRESS = np.dtype([(name, float) for name in (*_FOUND, "stiffness", "drag_give", "drag_stiffness", *_ENDS)])
"""Records of a solution: see Solution."""


class Solution(NamedTuple):
    """Room for what is computed while contacts are solved: records side by side in memory, or in lists.

    Attributes:
        places: of each active contact, its bodies, whether it is their first one, and when it was looked at last.
        presses: of each active contact, its rows, the inverse of how it gives, and how a pressure and a drag of 1 N
            move its first and its second body.
        bodies: of each body, when it was moved last (0: it is in no contact), by how much, and its a, u and h.
        members: numbers of the bodies in contacts.
    """

    places: Any
    presses: Any
    bodies: Any
    members: Any


class _Near(NamedTuple):
    """The bodies that may touch something, and their contacts, as the loops take them.

    Attributes:
        columns: which of all bodies they are, which contacts number: robots, things, and the world without bodies.
        robots: how many of them are robots.
        keys: of each contact, its bodies among all bodies, and its obstacle.
        worlds: of each contact, where it is.
        pairs: contacts of two robots, which come first.
        numbers: first and second bodies, obstacles and states.
        bodies: the rows of these bodies.
    """

    columns: np.ndarray
    robots: int
    keys: List[Tuple[int, int, int]]
    worlds: List[int]
    pairs: int
    numbers: List[Any]
    bodies: Any
    contacts: Any
    active: Any


def _make_records(count: int, kind: np.dtype) -> List[Any]:
    """Return records of zeros as objects in a list, which are read and written much faster than those of an array."""
    record: Any = type("Record", (), {"__slots__": kind.names})
    records = [record() for _ in range(count)]
    for each in records:
        for name in record.__slots__:
            setattr(each, name, 0)
    return records


class Contacts:
    """The bodies of worlds with the same arena.

    Attributes:
        states: of the robots (5, R), x y theta, and cosine and sine of theta; changed in place.
    """

    def __init__(
        self, arena: Arena, poses: np.ndarray, worlds: int, errors: RobotErrors, step_s: float,
        pushing: Sequence[Optional[Pushing]],
    ) -> None:  # fmt: skip
        """Put robots with errors at poses (3, R), spread evenly over the worlds; pushing: the things of each world."""
        rows = poses.shape[1]
        self._arena, self._pushing = arena, pushing
        self._rows, self._robots = rows, rows // worlds
        self._separations_m, self._radii_m = errors.wheel_separation_m[:, 0].copy(), errors.radius_m[:, 0]
        segments, thickness_m = list_obstacles(arena)
        self._segments, self._free_m = segments.for_each_place(), self._radii_m[:, None] + thickness_m
        obstacles = np.vstack((segments.start_m, segments.along_m, segments.length_m2, thickness_m))
        self._bodies = self._list_bodies(errors, step_s)
        self.states = self._bodies[X : SINE + 1, :rows]
        self._poses, self._headings = self.states[:3], self.states[3:]
        self._poses[:], self._headings[:] = poses, find_heading(poses[2])
        compiled = compile_loops(body_loops, rows)
        self._loops: Any = compiled or body_loops
        self._hold = np.ascontiguousarray if compiled else np.ndarray.tolist
        self._obstacles = self._hold(obstacles)
        self._near: Optional[_Near] = None
        self._solution = self._make_solution(0)
        self._is_compiled = compiled is not None and not any(pushing)
        # How far all robots may still move until the lists are incomplete, and until something could touch: in each
        # world, or in all together.
        self._reach_m, self._gap_m = np.full((2, worlds if self._is_compiled else 1), -np.inf)
        if self._is_compiled:
            self._ends = np.zeros((worlds, 2), dtype=np.int64)
            self._numbers = np.zeros((worlds, 4, 0), dtype=np.int64)
            self._contacts = np.zeros((worlds, CONTACT_ROWS, 0))
            self._make_room(_MANY * self._robots)
            self.move(np.empty((0, 2, rows)))  # loads what is compiled now: robots in real time would pause

    def _list_bodies(self, errors: RobotErrors, step_s: float) -> np.ndarray:
        """Return the rows of all bodies: robots, things, and what is never moved (see body_loops)."""
        rows, things = self._rows, [thing for own in self._pushing if own for thing in own.bodies]
        bodies = np.zeros((BODY_ROWS, rows + len(things) + 1))
        weights_n, loads = errors.mass_kg[:, 0] * GRAVITY_M_S2, errors.wheel_load[:, 0]
        bodies[HALF, :rows] = self._separations_m / 2.0
        bodies[WHEEL_N, :rows] = errors.wheel_friction[:, 0] * weights_n * loads / 2.0
        bodies[CASTER_N, :rows] = errors.friction[:, 2] * weights_n * (1.0 - loads)
        bodies[CREEP, :rows] = errors.creep_m_s[:, 0]
        bodies[RADIUS, :rows], bodies[[ON_ROBOT, ON_WALL], :rows] = self._radii_m, errors.friction[:, :2].T
        bodies[HALF, rows:-1] = [thing.shape.friction_radius_m for thing in things]
        bodies[WHEEL_N, rows:-1] = [thing.friction_n / 2.0 for thing in things]
        bodies[CREEP, rows:-1] = THING_CREEP_M_S
        bodies[CREEP] *= step_s
        bodies[COSINE, rows:] = 1.0
        return bodies

    def _make_room(self, room: int) -> None:
        """Make room for so many more contacts of each world."""
        worlds = len(self._gap_m)
        self._numbers = np.dstack((self._numbers, np.zeros((worlds, 4, room), dtype=np.int64)))
        self._contacts = np.dstack((self._contacts, np.zeros((worlds, CONTACT_ROWS, room))))
        self._contacts[:, SHARE] = 1.0
        room = self._contacts.shape[2]
        self._solution = self._make_solution(room)
        self._spare = np.zeros((3, room), dtype=np.int64), np.zeros((GIVE + 1 - PRESSURE, room))

    def _make_solution(self, contacts: int) -> Solution:
        """Return room to solve so many contacts at once."""
        bodies: int = self._bodies.shape[1]
        make: Any = _make_records if self._loops is body_loops else np.zeros
        members = self._hold(np.zeros(bodies, dtype=int))
        return Solution(make(contacts, _OF_PLACE), make(contacts, _OF_PRESS), make(bodies, _OF_BODY), members)

    def move(self, ground_m: np.ndarray) -> None:
        """Move the robots by K steps of their left and right wheels over the ground (K, 2, R)."""
        if not self._is_compiled:
            self._move_together(ground_m)
            return
        begun = np.zeros(len(self._gap_m), dtype=np.int64)
        while not self._loops.move_worlds(
            ground_m, self._separations_m, _MARGIN_M, begun, self._reach_m, self._gap_m, self._ends, self._numbers,
            self._contacts, self._bodies, self._obstacles, self._solution, *self._spare,
        ):  # fmt: skip
            self._make_room(self._contacts.shape[2] + 1)

    def _move_together(self, ground_m: np.ndarray) -> None:
        """Do what move_worlds() does, with arrays over the robots of all worlds."""
        travels_m, turns_rad = join_wheels(ground_m[:, 0], ground_m[:, 1], self._separations_m)
        fastest_m = np.abs(travels_m).max(axis=1).tolist()
        (x_m, y_m, theta_rad), (cosine, sine) = self._poses, self._headings
        for moved_m, turn_rad, *arc in zip(fastest_m, turns_rad, *shape_arc(travels_m, turns_rad)):
            step_x_m, step_y_m, cosine[:], sine[:] = follow_arc(cosine, sine, *arc)
            x_m += step_x_m
            y_m += step_y_m
            theta_rad += turn_rad
            self._note_motion(moved_m)
            if self._gap_m[0] <= 0.0:
                self._bodies[STEP_X : TURN + 1, : self._rows] = step_x_m, step_y_m, turn_rad
                self._separate()

    def _note_motion(self, moved_m: float) -> None:
        self._reach_m -= moved_m
        self._gap_m -= moved_m

    def _separate(self) -> None:
        """Move the bodies to where contacts let them go."""
        loops, near = self._loops, self._near
        if near is None or self._reach_m[0] < 0.0:
            near = self._near = self._list_near(near)
        bodies, (first, second, obstacle, state) = near.bodies, near.numbers
        bodies[:MOVING_ROWS] = self._hold(self._bodies[:MOVING_ROWS].take(near.columns, axis=1))
        touches, gap_m, count = loops.find_contacts(
            near.pairs, len(first), *near.numbers, near.contacts, bodies, self._obstacles, near.active
        )
        things = [own.list_touches(*self._list_robots(world)) if own else [] for world, own in enumerate(self._pushing)]
        self._gap_m[0] = min(gap_m, self._reach_m[0], *(own.gap_m for own in self._pushing if own))
        if not (touches or any(things)):
            return
        listed, contacts, pairs = near.active[:count], near.contacts, near.pairs
        worlds: List[List[int]] = [[] for _ in self._pushing]
        for k in listed:
            if k < pairs:
                worlds[near.worlds[k]].append(k)
        if any(things):
            first, second, state, contacts = self._add_things(near, things, worlds)
            bodies[MOVED_X : TURNED + 1] = self._hold(np.zeros((3, len(near.columns))))
        for k in listed:
            if k >= pairs:
                worlds[near.worlds[k]].append(k)
        pressure, gap = contacts[PRESSURE], contacts[GAP]
        if len(self._solution.presses) < len(gap):
            self._solution = self._make_solution(2 * len(gap))
        farthest_m, presses = 0.0, False
        for world, active in enumerate(worlds):
            for k in active:
                if pressure[k] != 0.0 or gap[k] < -TOUCH_M:
                    own = first, second, state, contacts, bodies, self._solution, near.robots, bool(things[world])
                    moved_m, pressed = loops.solve_contacts(active if loops is body_loops else np.array(active), *own)
                    farthest_m, presses = max(farthest_m, moved_m), presses or pressed
                    break
        loops.leave_walls(pairs, listed, second, obstacle, contacts, bodies, self._obstacles)
        self._bodies[:KEPT_ROWS, near.columns] = bodies[:KEPT_ROWS]
        if any(things):
            for row in range(PRESSURE, GIVE + 1):
                near.contacts[row][:] = contacts[row][: len(near.keys)]
            self._move_things(bodies, things)
        self._note_motion(farthest_m * math.sqrt(2.0))
        if presses:  # those that press on each other are looked at in each step
            self._gap_m[0] = 0.0

    def _list_robots(self, world: int) -> List[Any]:
        """Return the places, steps and turns of a world's robots."""
        own = slice(world * self._robots, (world + 1) * self._robots)
        known = self._poses[:2], self._bodies[STEP_X:TURN], self._bodies[TURN]
        return [values[..., own].T.tolist() for values in known]

    def _add_things(self, near: _Near, things: List[List[Touch]], worlds: List[List[int]]) -> List[Any]:
        """Return near's contacts with those of things behind them, and add these to the active ones of each world."""
        static, begin = len(near.columns) - 1, self._rows
        columns: List[np.ndarray] = []
        added: List[List[int]] = [[], [], []]
        for world, touches in enumerate(things):
            bodies = len(self._list_things(world))
            numbers = [*range(world * self._robots, (world + 1) * self._robots), *range(begin, begin + bodies), static]
            begin += bodies
            worlds[world] += range(len(near.keys) + len(columns), len(near.keys) + len(columns) + len(touches))
            for touch in touches:
                found, column = touch.contact, np.zeros(CONTACT_ROWS)
                column[FRICTION : SHARE + 1] = touch.friction, *touch.first_arms_m, *touch.second_arms_m, touch.share
                column[GAP : GAP + 4] = -found.depth_m, touch.slide_m, found.normal_x, found.normal_y
                columns.append(column)
                for values, value in zip(added, (numbers[touch.first], numbers[touch.second], touch.state)):
                    values.append(value)
        first, second, _, state = near.numbers
        joined = [np.array([*values, *new]) for values, new in zip((first, second, state), added)]
        return [self._hold(array) for array in (*joined, np.hstack((near.contacts, np.array(columns).T)))]

    def _list_things(self, world: int) -> List[PushedBody]:
        own = self._pushing[world]
        return own.bodies if own else []

    def _move_things(self, bodies: Any, things: List[List[Touch]]) -> None:
        number = self._rows
        for world, touches in enumerate(things):
            for thing in self._list_things(world):
                if touches and bodies[LEFT][number] >= bodies[CREEP][number]:
                    x_m, y_m, turn_rad = (float(bodies[row][number]) for row in range(MOVED_X, TURNED + 1))
                    thing.move((x_m, y_m, turn_rad))
                number += 1

    def _list_near(self, before: Optional[_Near]) -> _Near:
        """List which bodies are near each other, and near what."""
        self._reach_m[0] = _MARGIN_M
        near_m, rows, radii_m = SHIFT_M + _MARGIN_M, self._rows, self._radii_m
        firsts, seconds = self._find_pairs(2.0 * float(radii_m.max()) + 2.0 * near_m)
        away_m, free_m = self._segments.point_away(self._poses[:2, :, None]), self._free_m + near_m
        robots, obstacles = (square_length(away_m) < free_m * free_m).nonzero()
        things = self._bodies.shape[1] - 1 - rows
        near = np.arange(rows) if things else np.unique(np.concatenate((firsts, seconds, robots)))
        columns = np.concatenate((near, np.arange(rows, rows + things + 1)))
        contacts = np.zeros((CONTACT_ROWS, len(firsts) + len(robots)))
        contacts[TOUCHING] = np.concatenate((radii_m[firsts] + radii_m[seconds], self._free_m[robots, obstacles]))
        on_robot, on_wall = self._bodies[ON_ROBOT], self._bodies[ON_WALL]
        contacts[FRICTION] = np.concatenate((np.sqrt(on_robot[firsts] * on_robot[seconds]), on_wall[robots]))
        contacts[LEVER_1, : len(firsts)] = radii_m[firsts]
        seconds = np.concatenate((seconds, robots))
        contacts[LEVER_2], contacts[SHARE] = -radii_m[seconds], 1.0
        first = np.concatenate((near.searchsorted(firsts), np.full(len(robots), len(columns) - 1)))
        obstacle = np.concatenate((np.full(len(firsts), -1), obstacles))
        keys = list(zip(columns[first].tolist(), seconds.tolist(), obstacle.tolist()))
        if before and any(before.contacts[PRESSURE]):
            forces = dict(zip(before.keys, np.array(before.contacts)[PRESSURE : GIVE + 1].T))
            for k in [k for k, key in enumerate(keys) if key in forces]:
                contacts[PRESSURE : GIVE + 1, k] = forces[keys[k]]
        numbers = [self._hold(each) for each in (first, near.searchsorted(seconds), obstacle, np.zeros_like(first))]
        worlds, active = (seconds // self._robots).tolist(), self._hold(np.zeros_like(first))
        bodies = self._hold(self._bodies.take(columns, axis=1))
        return _Near(columns, len(near), keys, worlds, len(firsts), numbers, bodies, self._hold(contacts), active)

    def _find_pairs(self, distance_m: float) -> np.ndarray:
        """Return the rows (2, P) of the first and the second of all two robots less than distance_m apart."""
        places_m, robots = self._poses[:2].reshape(2, -1, self._robots), self._robots
        near = square_length(places_m[..., None] - places_m[:, :, None]) < distance_m * distance_m
        worlds, firsts, seconds = (near & np.triu(np.ones((robots, robots), dtype=bool), k=1)).nonzero()
        return np.array((worlds * robots + firsts, worlds * robots + seconds))

    def measure_overlaps(self) -> Tuple[np.ndarray, np.ndarray]:
        """Return how deep (m) each robot is in another robot at most (R,), and in a wall or obstacle (R,)."""
        places_m = self._poses[:2]
        pairs = self._find_pairs(2.0 * float(self._radii_m.max()))
        distances_m = np.sqrt(square_length(places_m[:, pairs[0]] - places_m[:, pairs[1]]))
        depths_m = self._radii_m[pairs].sum(axis=0) - distances_m
        robots_m = np.zeros(self._rows)
        # Not broadcast: numpy 2.2 reads past the end of values that are.
        np.maximum.at(robots_m, pairs.ravel(), np.tile(depths_m, 2))
        return robots_m, np.maximum(self._radii_m - measure_clearance(places_m.T, self._arena), 0.0)
