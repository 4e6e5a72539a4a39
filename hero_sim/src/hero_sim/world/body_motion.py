"""Where the bodies of all robots are: they roll with their wheels, and push each other.

Pure: numpy only, over all robots of all worlds at once, quantities first and robots last.
"""

import numpy as np

from .arena import Arena
from .contacts import Contacts
from .kinematics import find_heading, follow_arcs, join_wheels

__all__ = ["BodyMotion"]


class BodyMotion:
    """The bodies in worlds with the same arena.

    Attributes:
        poses: x m, y m, theta rad in the frame world (3, R); updated in place.
        headings: cosine and sine of theta (2, R); updated in place.
    """

    def __init__(self, arena: Arena, worlds: int, poses: np.ndarray) -> None:
        """Place the bodies at poses (3, R)."""
        self.poses = poses
        self.headings = np.array(find_heading(poses[2]))
        self.contacts = Contacts(arena, worlds, poses.shape[1])

    def roll(self, ground_m: np.ndarray) -> None:
        """Move all bodies by K steps of their left and right wheels over the ground (K, 2, R)."""
        travels_m, rotations_rad = join_wheels(ground_m[:, 0], ground_m[:, 1])
        fastest_m = np.abs(travels_m).max(axis=1).tolist()
        ways_m, self.headings[:] = follow_arcs(self.headings, travels_m, rotations_rad)
        places_m, theta_rad = self.poses[:2], self.poses[2]
        for moved_m, way_m, rotation_rad in zip(fastest_m, ways_m, rotations_rad):
            places_m += way_m
            theta_rad += rotation_rad
            if self.contacts.could_touch(moved_m):
                self.contacts.separate(places_m)
