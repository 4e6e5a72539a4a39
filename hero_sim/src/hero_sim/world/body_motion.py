"""Motion of all robots' bodies: they roll with their wheels, and push each other.

Pure: numpy only, over all robots of all worlds at once, quantities first and robots last.
"""

import math
from typing import Iterable, List, Sequence

import numpy as np

from .arena import Arena, MovableObject
from .contacts import Contacts
from .kinematics import find_heading, follow_arcs, join_wheels
from .pushing.pushing import Place, Pushing

_PASSES = 4
"""In which robots leave objects and each other: between an object and other robots one has no better place."""


class BodyMotion:
    """The bodies in worlds with the same arena.

    Attributes:
        poses: x m, y m, theta rad in the frame world (3, R); updated in place.
        headings: cosine and sine of theta (2, R); updated in place.
        pushing: of each world with objects; empty if there are none.
    """

    def __init__(
        self,
        arena: Arena,
        objects: Sequence[Sequence[MovableObject]],
        poses: np.ndarray,
        radii_m: np.ndarray,
        separations_m: np.ndarray,
    ) -> None:
        """Place the bodies, of radii_m (R,) and with wheels separations_m (R,) apart, at poses (3, R), and objects.

        objects: of each world.
        """
        self.poses = poses
        self.headings = np.array(find_heading(poses[2]))
        self._separations_m = separations_m
        self.contacts = Contacts(arena, len(objects), radii_m)
        obstacles = arena.segments_m.tolist(), arena.circles_m.tolist()
        self.pushing = [
            Pushing([thing.put_down() for thing in things], *obstacles, radii_m=own_m)
            for things, own_m in zip(objects, radii_m.reshape(len(objects), -1).tolist())
            if things
        ]

    def roll(self, ground_m: np.ndarray) -> None:
        """Move all bodies by K steps of their left and right wheels over the ground (K, 2, R)."""
        travels_m, rotations_rad = join_wheels(ground_m[:, 0], ground_m[:, 1], self._separations_m)
        fastest_m = np.abs(travels_m).max(axis=1).tolist()
        displacements_m, self.headings[:] = follow_arcs(self.headings, travels_m, rotations_rad)
        places_m, theta_rad = self.poses[:2], self.poses[2]
        for moved_m, displacement_m, rotation_rad in zip(fastest_m, displacements_m, rotations_rad):
            before_m = places_m.copy() if self.pushing else places_m
            places_m += displacement_m
            theta_rad += rotation_rad
            if self.contacts.could_touch(moved_m):
                self.contacts.separate(places_m)
            if self.pushing:
                self._push(before_m)

    def _push(self, before_m: np.ndarray) -> None:
        """Push objects by the robots that moved from before_m (2, R), and move all bodies out of each other."""
        places_m = self.poses[:2]
        befores_m, afters_m = self._list_places(before_m), self._list_places(places_m)
        slipped_m = self._place(map(Pushing.step, self.pushing, befores_m, afters_m))
        for _ in range(_PASSES):
            if slipped_m == 0.0 or not self.contacts.could_touch(slipped_m):
                return
            self.contacts.separate(places_m)
            slipped_m = self._place(map(Pushing.push_out, self.pushing, self._list_places(places_m)))

    def _list_places(self, places_m: np.ndarray) -> List[List[Place]]:
        """Return the places of the robots of each world."""
        return places_m.T.reshape(len(self.pushing), -1, 2).tolist()

    def _place(self, worlds_m: Iterable[List[Place]]) -> float:
        """Put the robots of each world at new places; return how far the farthest moved."""
        places_m = np.concatenate(list(worlds_m)).T
        moved_m = float(np.abs(places_m - self.poses[:2]).max()) * math.sqrt(2.0)
        self.poses[:2] = places_m
        return moved_m
