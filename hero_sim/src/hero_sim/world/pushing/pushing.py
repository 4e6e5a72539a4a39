"""The things of one world, where they touch robots, each other and walls, and how they are moved. Pure.

What a touch does is up to body_loops.py. Things move only while a robot presses on one of them.
"""

import math
from typing import List, NamedTuple, Sequence, Tuple

from ..body_loops import CONTINUES, STARTS
from .shapes import Contact, PushedBody, find_contacts, touch_circle, touch_walls

CONTACT_FRICTION = 0.3
"""Coefficient of friction between things, and of things with walls (plastic on cardboard); a robot has its own."""

MARGIN_M = 0.004
"""Bodies nearer than this may come to touch in the step: more than the fastest robot moves."""

STATIC = -1
"""The first body of a touch with a wall or an obstacle."""

Place = Sequence[float]
"""x m, y m."""

Arms = Tuple[float, float]
"""Moment arms (m) of a pressure and a drag about a body's center."""


class Touch(NamedTuple):
    """A contact, as body_loops.py takes it. Bodies are numbered: robots, then things."""

    first: int
    second: int
    contact: Contact
    first_arms_m: Arms
    second_arms_m: Arms
    slide_m: float
    friction: float
    state: int
    share: float


class Pushing:
    """The things of one world.

    Attributes:
        bodies: in a fixed order.
        gap_m: how far robots may move until one could touch a thing.
    """

    def __init__(
        self,
        bodies: Sequence[PushedBody],
        walls_m: Sequence[Tuple[float, float, float, float]],
        circles_m: Sequence[Tuple[float, float, float]],
        radii_m: Sequence[float],
        frictions: Sequence[float],
    ) -> None:
        """walls_m: x1 y1 x2 y2 of each; circles_m: round obstacles, x y radius; radii_m, frictions: of robots."""
        self.bodies = list(bodies)
        self.gap_m = -math.inf
        self._walls_m, self._circles_m = walls_m, circles_m
        self._radii_m, self._frictions = radii_m, frictions

    def list_touches(
        self, places_m: Sequence[Place], steps_m: Sequence[Place], turns_rad: Sequence[float]
    ) -> List[Touch]:
        """Return all touches if robots, which moved to places_m in this step, reach things; none otherwise."""
        self.gap_m = math.inf
        touches: List[Touch] = []
        for robot, (place_m, radius_m) in enumerate(zip(places_m, self._radii_m)):
            for index, pushed in enumerate(self.bodies):
                away_x, away_y = pushed.x_m - place_m[0], pushed.y_m - place_m[1]
                gap_m = math.sqrt(away_x * away_x + away_y * away_y) - radius_m - pushed.shape.reach_m
                if gap_m < MARGIN_M:
                    contact = touch_circle(place_m[0], place_m[1], radius_m, pushed)
                    gap_m = -contact.depth_m
                    if gap_m < MARGIN_M:
                        (step_x, step_y), turn_rad = steps_m[robot], turns_rad[robot]
                        slide_m = contact.normal_y * step_x - contact.normal_x * step_y - radius_m * turn_rad
                        second = len(places_m) + index
                        arms_m, friction = _list_arms(contact, pushed), self._frictions[robot]
                        touch = Touch(robot, second, contact, (0.0, radius_m), arms_m, slide_m, friction, STARTS, 1.0)
                        touches.append(touch)
                self.gap_m = min(self.gap_m, gap_m)
        if self.gap_m > 0.0:
            return []
        return touches + self._list_others(len(places_m))

    def _list_others(self, robots: int) -> List[Touch]:
        """Return where things touch each other and walls, or could in this step."""
        touches = []
        for second, pushed in enumerate(self.bodies):
            for first in range(second):
                pusher = self.bodies[first]
                reach_m = pusher.shape.reach_m + pushed.shape.reach_m + MARGIN_M
                away_x, away_y = pushed.x_m - pusher.x_m, pushed.y_m - pusher.y_m
                if away_x * away_x + away_y * away_y < reach_m * reach_m:
                    contacts = find_contacts(pusher, pushed, MARGIN_M)
                    arms_m = [(_list_arms(contact, pusher), _list_arms(contact, pushed)) for contact in contacts]
                    touches += _join(robots + first, robots + second, contacts, arms_m)
            contacts = touch_walls(pushed, self._walls_m, MARGIN_M)
            obstacles = (touch_circle(*circle_m, pushed) for circle_m in self._circles_m)
            contacts += [contact for contact in obstacles if contact.depth_m > -MARGIN_M]
            arms_m = [((0.0, 0.0), _list_arms(contact, pushed)) for contact in contacts]
            touches += _join(STATIC, robots + second, contacts, arms_m)
        return touches


def _list_arms(contact: Contact, body: PushedBody) -> Arms:
    x_m, y_m = contact.x_m - body.x_m, contact.y_m - body.y_m
    return x_m * contact.normal_y - y_m * contact.normal_x, x_m * contact.normal_x + y_m * contact.normal_y


def _join(first: int, second: int, contacts: Sequence[Contact], arms_m: Sequence[Tuple[Arms, Arms]]) -> List[Touch]:
    """Return the touches of two bodies, which are solved at once."""
    count = len(contacts)
    return [
        Touch(first, second, contact, arms[0], arms[1], 0.0, CONTACT_FRICTION, CONTINUES if k else STARTS, float(count))
        for k, (contact, arms) in enumerate(zip(contacts, arms_m))
    ]
