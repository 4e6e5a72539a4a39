"""Contacts of robots, pushed bodies and walls, in one world and one step after the other. Pure.

The motion that takes all bodies out of what presses on them is found contact by contact in a fixed order, again and
again (Gauss-Seidel), with a friction cone at each. A robot has traction for MAX_PUSH_N only: if the least motion needs
more from one of them, the bodies stay, and its wheels slip. Nothing moves without being pushed: no energy is created.
"""

import itertools
import math
from typing import Dict, List, Optional, Sequence, Tuple

from ...robot_constants import BODY_RADIUS_M
from .shapes import Contact, Motion, PushedBody, find_contacts, touch_circle, touch_walls

MAX_PUSH_N = 0.77
"""Traction of a robot: 0.156 kg at an assumed friction of 0.5 with the floor."""

CONTACT_FRICTION = 0.3
"""Coefficient of friction between a robot or a wall and a body, and between bodies (plastic on cardboard)."""

MARGIN_M = 0.004
"""Bodies nearer than this may come to touch in the step: more than the fastest robot moves."""

SWEEPS = 60
TOLERANCE_M = 1e-7

SLIPS = 8
"""Halvings of the limit of a robot's pressure before all are taken to be too weak."""

COMPLIANCE = 0.002
"""Compliance of contacts with robots, as a share of the body's own: how robots side by side share the force."""

Place = Sequence[float]
"""x m, y m."""

Motions = Dict[int, Motion]
"""By the indices of the bodies that move."""

Ends = Sequence[Tuple[int, float, PushedBody]]
"""The bodies of a contact that can move: index, sign of the motion, body."""


class _Axis:
    """The normal or the tangent of a contact, and the bodies that move under pressure along it.

    Attributes:
        x, y: its direction.
        give_m: how far the touching points come apart for one unit of pressure.
    """

    def __init__(self, contact: Contact, x: float, y: float, ends: Ends) -> None:
        self.x, self.y = x, y
        # Last: the moment arm (m) of the pressure about the body's center.
        self._ends = [
            (index, sign, body, (contact.x_m - body.x_m) * y - (contact.y_m - body.y_m) * x)
            for index, sign, body in ends
        ]
        self.give_m = sum((1.0 + arm_m / body.radius_m2 * arm_m) / body.friction_n for _, _, body, arm_m in self._ends)

    def measure_motion(self, motions: Motions) -> float:
        """Return how far the second body's point has moved along the axis relative to the first one's."""
        moved_m = 0.0
        for index, sign, _, arm_m in self._ends:
            if index in motions:
                x_m, y_m, rotation_rad = motions[index]
                moved_m += sign * (x_m * self.x + y_m * self.y + rotation_rad * arm_m)
        return moved_m

    def press(self, pressure: float, motions: Motions) -> None:
        """Add to motions what pressure does to the bodies."""
        if pressure == 0.0:
            return
        for index, sign, body, arm_m in self._ends:
            share = sign * pressure / body.friction_n
            x_m, y_m, rotation_rad = motions.get(index, (0.0, 0.0, 0.0))
            motions[index] = x_m + share * self.x, y_m + share * self.y, rotation_rad + share * arm_m / body.radius_m2


class _Touch:
    """A contact of which the second body is pushed.

    Attributes:
        robot: index of the robot that presses; None: a body or a wall.
        along, across: pressure along the normal and the tangent.
    """

    def __init__(self, contact: Contact, ends: Ends, robot: Optional[int] = None, moved_m: Place = (0.0, 0.0)) -> None:
        """moved_m: how far the robot moved in this step."""
        self.normal = _Axis(contact, contact.normal_x, contact.normal_y, ends)
        self.tangent = _Axis(contact, -contact.normal_y, contact.normal_x, ends)
        self.robot = robot
        self.along = self.across = 0.0
        self._depth_m = contact.depth_m
        self._slid_m = moved_m[0] * self.tangent.x + moved_m[1] * self.tangent.y
        self._softness = 0.0 if robot is None else COMPLIANCE

    def relax(self, limit: float, motions: Motions) -> float:
        """Resolve the pressure, of a robot up to limit; return how far that moved anything."""
        give_m = self.normal.give_m * (1.0 + self._softness)
        missing_m = self._depth_m - self.normal.measure_motion(motions) - self._softness * self.along * give_m
        along = max(0.0, self.along + missing_m / give_m)
        if self.robot is not None:
            along = min(along, limit)
        change = along - self.along
        self.along = along
        self.normal.press(change, motions)
        slide_m = self._slid_m - self.tangent.measure_motion(motions)
        cone = CONTACT_FRICTION * along
        across = min(max(self.across + slide_m / self.tangent.give_m, -cone), cone)
        self.tangent.press(across - self.across, motions)
        self.across = across
        return abs(change) * give_m


class Pushing:
    """The bodies of one world.

    Attributes:
        bodies: in a fixed order.
    """

    def __init__(
        self,
        bodies: Sequence[PushedBody],
        walls_m: Sequence[Tuple[float, float, float, float]],
        circles_m: Sequence[Tuple[float, float, float]] = (),
        radii_m: Optional[Sequence[float]] = None,
    ) -> None:
        """walls_m: x1 y1 x2 y2 of each; circles_m: round obstacles, x y radius; radii_m: of robots, None for stock."""
        self._radii_m = itertools.repeat(BODY_RADIUS_M) if radii_m is None else radii_m
        self.bodies = list(bodies)
        self._walls_m = list(walls_m)
        self._circles_m = list(circles_m)

    def step(self, before_m: Sequence[Place], after_m: Sequence[Place]) -> List[Place]:
        """Push bodies by robots that moved from before_m to after_m; return places of the robots outside of bodies."""
        pushes = self._list_pushes(before_m, after_m)
        if not pushes:
            return list(after_m)
        touches = pushes + self._list_others()
        limit = math.inf
        for _ in range(SLIPS):
            motions = _solve(touches, limit)
            if self._has_traction(pushes, motions):
                for index, motion in motions.items():
                    self.bodies[index].move(motion)
                break
            # The wheels of the robot that presses hardest slip, until others carry their share.
            limit = max(push.along for push in pushes) / 2.0
        return self.push_out(after_m)

    def push_out(self, places_m: Sequence[Place]) -> List[Place]:
        """Return places of robots out of the bodies that they reach into: their wheels slip."""
        return [self._leave(place_m, radius_m) for place_m, radius_m in zip(places_m, self._radii_m)]

    def _list_pushes(self, before_m: Sequence[Place], after_m: Sequence[Place]) -> List[_Touch]:
        pushes = []
        for robot, (place_m, old_m, radius_m) in enumerate(zip(after_m, before_m, self._radii_m)):
            for index, pushed in enumerate(self.bodies):
                reach_m = radius_m + pushed.shape.reach_m
                away_x, away_y = pushed.x_m - place_m[0], pushed.y_m - place_m[1]
                if away_x * away_x + away_y * away_y < reach_m * reach_m:
                    contact = touch_circle(place_m[0], place_m[1], radius_m, pushed)
                    if contact.depth_m > 0.0:
                        moved_m = (place_m[0] - old_m[0], place_m[1] - old_m[1])
                        pushes.append(_Touch(contact, [(index, 1.0, pushed)], robot, moved_m))
        return pushes

    def _list_others(self) -> List[_Touch]:
        """Return where bodies touch each other and walls, or could in this step."""
        touches = []
        for second, pushed in enumerate(self.bodies):
            for first in range(second):
                pusher = self.bodies[first]
                reach_m = pusher.shape.reach_m + pushed.shape.reach_m + MARGIN_M
                away_x, away_y = pushed.x_m - pusher.x_m, pushed.y_m - pusher.y_m
                if away_x * away_x + away_y * away_y < reach_m * reach_m:
                    ends = [(second, 1.0, pushed), (first, -1.0, pusher)]
                    contacts = find_contacts(pusher, pushed, MARGIN_M)
                    touches += [_Touch(contact, ends) for contact in contacts]
            contacts = touch_walls(pushed, self._walls_m, MARGIN_M)
            obstacles = (touch_circle(*circle_m, pushed) for circle_m in self._circles_m)
            contacts += [contact for contact in obstacles if contact.depth_m > -MARGIN_M]
            touches += [_Touch(contact, [(second, 1.0, pushed)]) for contact in contacts]
        return touches

    def _has_traction(self, pushes: Sequence[_Touch], motions: Motions) -> bool:
        """Return whether no robot has to push harder than it can: the robots' work is that against friction."""
        friction_j = sum(self.bodies[index].measure_work(motion) for index, motion in motions.items())
        pushed_j = 0.0
        loads: Dict[Optional[int], float] = {}
        for push in pushes:
            pushed_j += push.along * push.normal.measure_motion(motions)
            pushed_j += push.across * push.tangent.measure_motion(motions)
            load = math.sqrt(push.along * push.along + push.across * push.across)
            loads[push.robot] = loads.get(push.robot, 0.0) + load
        # Wedged between walls bodies move nowhere, whatever presses.
        return pushed_j > 0.0 and max(loads.values()) * friction_j <= MAX_PUSH_N * pushed_j

    def _leave(self, place_m: Place, radius_m: float) -> Place:
        for pushed in self.bodies:
            reach_m = radius_m + pushed.shape.reach_m
            away_x, away_y = pushed.x_m - place_m[0], pushed.y_m - place_m[1]
            if away_x * away_x + away_y * away_y >= reach_m * reach_m:
                continue
            contact = touch_circle(place_m[0], place_m[1], radius_m, pushed)
            if contact.depth_m > 0.0:
                place_m = (
                    place_m[0] - contact.normal_x * contact.depth_m,
                    place_m[1] - contact.normal_y * contact.depth_m,
                )
        return place_m


def _solve(touches: Sequence[_Touch], limit: float) -> Motions:
    """Press the bodies of touches apart, robots up to limit; return their motions."""
    motions: Motions = {}
    for touch in touches:
        touch.along = touch.across = 0.0
    for _ in range(SWEEPS):
        if max([touch.relax(limit, motions) for touch in touches]) < TOLERANCE_M:
            break
    return motions
