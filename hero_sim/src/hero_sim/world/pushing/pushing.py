"""Contacts of robots, pushed bodies and walls, in one world and one step after the other. Pure.

The motion that takes all bodies out of what presses on them is found contact by contact in a fixed order, again and
again (Gauss-Seidel), with a friction cone at each. A robot has traction for MAX_PUSH_N only: if the least motion needs
more from one of them, the bodies stay, and its wheels slip. Nothing moves without being pushed: no energy is created.
"""

import itertools
import math
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

from ...robot_constants import BODY_RADIUS_M
from .pushed_body import Motion, PushedBody
from .shapes import Contact, find_contacts, touch_circle, touch_walls

MAX_PUSH_N = 0.77
"""Traction of a robot: 0.156 kg at an assumed friction of 0.5 with the floor."""

CONTACT_FRICTION = 0.3
"""Between a robot or a wall and a body, and between bodies (plastic on cardboard)."""

MARGIN_M = 0.004
"""Bodies nearer than this may come to touch in the step: more than the fastest robot moves."""

SWEEPS = 60
TOLERANCE_M = 1e-7

SLIPS = 8
"""Halvings of the limit of a robot's pressure before all are taken to be too weak."""

COMPLIANCE = 0.002
"""Of a contact with a robot, as a share of the body's own: how robots that press side by side share the force."""

Place = Sequence[float]
"""x m, y m."""


class _Touch(NamedTuple):
    """A contact of which the second body is pushed.

    Attributes:
        pusher: index of the body that presses; None: a robot or a wall.
        robot: index of the robot that presses, or None.
        moved_m: how far the robot moved in this step.
    """

    contact: Contact
    pusher: Optional[int]
    pushed: int
    robot: Optional[int]
    moved_m: Place


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
            motions, pressures = self._solve(touches, limit)
            if self._has_traction(touches, motions, pressures):
                for index, motion in motions.items():
                    self.bodies[index].move(motion)
                break
            # The wheels of the robot that presses hardest slip, until others carry their share.
            limit = (
                max(along for touch, (along, _) in zip(touches, pressures) if touch.robot is not None) / 2.0
            )
        return self.push_out(after_m)

    def push_out(self, places_m: Sequence[Place]) -> List[Place]:
        """Return places of robots out of the bodies that they reach into: their wheels slip."""
        return [self._leave(place_m, radius_m) for place_m, radius_m in zip(places_m, self._radii_m)]

    def _list_pushes(self, before_m: Sequence[Place], after_m: Sequence[Place]) -> List[_Touch]:
        pushes = []
        for robot, (place_m, old_m, radius_m) in enumerate(zip(after_m, before_m, self._radii_m)):
            for index, pushed in enumerate(self.bodies):
                body = pushed.body
                reach_m = radius_m + body.shape.reach_m
                away_x, away_y = body.x_m - place_m[0], body.y_m - place_m[1]
                if away_x * away_x + away_y * away_y < reach_m * reach_m:
                    contact = touch_circle(place_m[0], place_m[1], radius_m, body)
                    if contact.depth_m > 0.0:
                        moved_m = (place_m[0] - old_m[0], place_m[1] - old_m[1])
                        pushes.append(_Touch(contact, None, index, robot, moved_m))
        return pushes

    def _list_others(self) -> List[_Touch]:
        """Return where bodies touch each other and walls, or could in this step."""
        touches = []
        for second, pushed in enumerate(self.bodies):
            for first in range(second):
                pusher = self.bodies[first].body
                reach_m = pusher.shape.reach_m + pushed.body.shape.reach_m + MARGIN_M
                away_x, away_y = pushed.body.x_m - pusher.x_m, pushed.body.y_m - pusher.y_m
                if away_x * away_x + away_y * away_y < reach_m * reach_m:
                    contacts = find_contacts(pusher, pushed.body, MARGIN_M)
                    touches += [_Touch(contact, first, second, None, (0.0, 0.0)) for contact in contacts]
            contacts = touch_walls(pushed.body, self._walls_m, MARGIN_M)
            obstacles = (touch_circle(*circle_m, pushed.body) for circle_m in self._circles_m)
            contacts += [contact for contact in obstacles if contact.depth_m > -MARGIN_M]
            touches += [_Touch(contact, None, second, None, (0.0, 0.0)) for contact in contacts]
        return touches

    def _solve(
        self, touches: Sequence[_Touch], limit: float
    ) -> Tuple[Dict[int, Motion], List[Tuple[float, float]]]:
        """Return the motion of each body that moves, and the pressure along and across the normal of each touch.

        limit: of the pressure of a robot.
        """
        motions: Dict[int, Motion] = {}
        pressures = [(0.0, 0.0)] * len(touches)
        for _ in range(SWEEPS):
            largest_m = 0.0
            for number, touch in enumerate(touches):
                pressures[number], change_m = self._relax(touch, pressures[number], limit, motions)
                largest_m = max(largest_m, change_m)
            if largest_m < TOLERANCE_M:
                break
        return motions, pressures

    def _relax(
        self, touch: _Touch, pressure: Tuple[float, float], limit: float, motions: Dict[int, Motion]
    ) -> Tuple[Tuple[float, float], float]:
        """Resolve the pressure of one touch; return its pressure, and how far that moved anything."""
        contact = touch.contact
        normal = contact.normal_x, contact.normal_y
        tangent = -contact.normal_y, contact.normal_x
        softness = COMPLIANCE if touch.robot is not None else 0.0
        give_m = self._measure_give(touch, normal) * (1.0 + softness)
        missing_m = (
            contact.depth_m - self._measure_motion(touch, normal, motions) - softness * pressure[0] * give_m
        )
        most = limit if touch.robot is not None else math.inf
        along = min(max(0.0, pressure[0] + missing_m / give_m), most)
        self._press(touch, normal, along - pressure[0], motions)
        change_m = abs(along - pressure[0]) * give_m
        slide_m = (
            touch.moved_m[0] * tangent[0]
            + touch.moved_m[1] * tangent[1]
            - self._measure_motion(touch, tangent, motions)
        )
        cone = CONTACT_FRICTION * along
        across = min(max(pressure[1] + slide_m / self._measure_give(touch, tangent), -cone), cone)
        self._press(touch, tangent, across - pressure[1], motions)
        return (along, across), change_m

    def _measure_give(self, touch: _Touch, direction: Place) -> float:
        """Return how far the touching points come apart along direction for one unit of pressure."""
        give_m = 0.0
        for index, _ in _list_ends(touch):
            pushed = self.bodies[index]
            arm_m = _find_arm(pushed, touch.contact, direction)
            _, _, rotation_rad = pushed.yield_to(direction[0], direction[1], arm_m)
            give_m += (1.0 + rotation_rad * arm_m) / pushed.friction_n
        return give_m

    def _measure_motion(self, touch: _Touch, direction: Place, motions: Dict[int, Motion]) -> float:
        """Return how far the second body's point has moved along direction, seen from the first one's."""
        moved_m = 0.0
        for index, sign in _list_ends(touch):
            if index in motions:
                x_m, y_m, rotation_rad = motions[index]
                arm_m = _find_arm(self.bodies[index], touch.contact, direction)
                moved_m += sign * (x_m * direction[0] + y_m * direction[1] + rotation_rad * arm_m)
        return moved_m

    def _press(self, touch: _Touch, direction: Place, pressure: float, motions: Dict[int, Motion]) -> None:
        if pressure == 0.0:
            return
        for index, sign in _list_ends(touch):
            pushed = self.bodies[index]
            share = sign * pressure / pushed.friction_n
            arm_m = _find_arm(pushed, touch.contact, direction)
            x_m, y_m, rotation_rad = pushed.yield_to(
                share * direction[0], share * direction[1], share * arm_m
            )
            old = motions.get(index, (0.0, 0.0, 0.0))
            motions[index] = old[0] + x_m, old[1] + y_m, old[2] + rotation_rad

    def _has_traction(
        self, touches: Sequence[_Touch], motions: Dict[int, Motion], pressures: Sequence[Tuple[float, float]]
    ) -> bool:
        """Return whether no robot has to push harder than it can: the robots' work is that against friction."""
        friction_j = sum(self.bodies[index].measure_work(motion) for index, motion in motions.items())
        pushed_j, loads = 0.0, {}  # type: Tuple[float, Dict[int, float]]
        for touch, (along, across) in zip(touches, pressures):
            if touch.robot is not None:
                contact = touch.contact
                normal, tangent = (contact.normal_x, contact.normal_y), (-contact.normal_y, contact.normal_x)
                pushed_j += along * self._measure_motion(touch, normal, motions)
                pushed_j += across * self._measure_motion(touch, tangent, motions)
                load = math.sqrt(along * along + across * across)
                loads[touch.robot] = loads.get(touch.robot, 0.0) + load
        # Wedged between walls bodies move nowhere, whatever presses.
        if pushed_j <= 0.0:
            return False
        return max(loads.values()) * friction_j <= MAX_PUSH_N * pushed_j

    def _leave(self, place_m: Place, radius_m: float) -> Place:
        for pushed in self.bodies:
            reach_m = radius_m + pushed.body.shape.reach_m
            away_x, away_y = pushed.body.x_m - place_m[0], pushed.body.y_m - place_m[1]
            if away_x * away_x + away_y * away_y >= reach_m * reach_m:
                continue
            contact = touch_circle(place_m[0], place_m[1], radius_m, pushed.body)
            if contact.depth_m > 0.0:
                place_m = (
                    place_m[0] - contact.normal_x * contact.depth_m,
                    place_m[1] - contact.normal_y * contact.depth_m,
                )
        return place_m


def _list_ends(touch: _Touch) -> List[Tuple[int, float]]:
    """Return the bodies of a touch that can move, and the sign of their motion."""
    ends = [(touch.pushed, 1.0)]
    if touch.pusher is not None:
        ends.append((touch.pusher, -1.0))
    return ends


def _find_arm(pushed: PushedBody, contact: Contact, direction: Place) -> float:
    """Return the moment arm (m) about the body's center of a force along direction at the contact."""
    return (contact.x_m - pushed.pose.x_m) * direction[1] - (contact.y_m - pushed.pose.y_m) * direction[0]
