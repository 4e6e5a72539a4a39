"""A body that can be pushed over the floor: where it is, how heavy, and how it moves under a force. Pure.

Quasi-static: it moves only while it is pushed. Its friction with the floor is an ellipsoid limit surface (Goyal, Ruina
and Papadopoulos 1991; Lynch and Mason 1996): a force f through its center and a moment m about it turn into the twist
(vx, vy, w) ~ (fx, fy, m / c^2), with c the friction radius of its shape.
"""

import copy
import math
from typing import Tuple

from hero_node.geometry import Pose

from .shapes import Body, Shape, place

GRAVITY_M_S2 = 9.81

Motion = Tuple[float, float, float]
"""x m, y m, rotation rad."""


class PushedBody:
    """One body on the floor.

    Attributes:
        pose: of its center, frame world.
        body: its shape at this pose.
        friction_n: the force through its center that just moves it.
        radius_m2: the square of c.
    """

    def __init__(self, shape: Shape, pose: Pose, mass_kg: float, friction: float) -> None:
        """Put it down; friction is the coefficient between it and the floor.

        Raises: ValueError for a number that is not more than 0.
        """
        for name, value in (("mass_kg", mass_kg), ("friction", friction)):
            if not 0.0 < value < math.inf:
                raise ValueError("%s must be more than 0, not %g" % (name, value))
        self.friction_n = mass_kg * friction * GRAVITY_M_S2
        self._shape = shape
        self.radius_m2 = shape.friction_radius_m * shape.friction_radius_m
        self._set(pose, math.cos(pose.yaw_rad), math.sin(pose.yaw_rad))

    def _set(self, pose: Pose, cosine: float, sine: float) -> None:
        self.pose, self._heading = pose, (cosine, sine)
        self.body: Body = place(self._shape, pose.x_m, pose.y_m, cosine, sine)

    def put(self, pose: Pose) -> "PushedBody":
        """Return a copy at pose."""
        body = copy.copy(self)
        body._set(pose, math.cos(pose.yaw_rad), math.sin(pose.yaw_rad))
        return body

    def measure_work(self, motion: Motion) -> float:
        """Return the work (J) against the floor's friction of a motion."""
        x_m, y_m, rotation_rad = motion
        return self.friction_n * math.sqrt(
            x_m * x_m + y_m * y_m + self.radius_m2 * rotation_rad * rotation_rad
        )

    def move(self, motion: Motion) -> None:
        """Move by less than half a radian."""
        x_m, y_m, rotation_rad = motion
        cosine, sine = self._heading
        # The half-angle form keeps the heading's length to the second order; the rest is divided out.
        half = rotation_rad * (0.5 + rotation_rad * rotation_rad / 24.0)
        scale = 1.0 / (1.0 + half * half)
        turn_cosine, turn_sine = (1.0 - half * half) * scale, 2.0 * half * scale
        cosine, sine = cosine * turn_cosine - sine * turn_sine, cosine * turn_sine + sine * turn_cosine
        length = math.sqrt(cosine * cosine + sine * sine)
        pose = Pose(self.pose.x_m + x_m, self.pose.y_m + y_m, self.pose.yaw_rad + rotation_rad)
        self._set(pose, cosine / length, sine / length)
