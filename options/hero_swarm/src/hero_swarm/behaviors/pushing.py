"""Behaviors that push objects: gathering them, and moving one of them to a goal, alone or together."""

from typing import Any, NamedTuple

import numpy as np

from hero_client.controllers import steer
from hero_client.values import BODY_RADIUS_M, OBJECT, ROBOT
from hero_node.parameters import number
from hero_sim.world import join_wheels

from ..behavior import SPEED, Behavior, Command, Neighbors, Objects, Random, Sensed, Sight, turn
from .clearance import keep_apart

_COORDINATE = number(0.0, -1000.0, 1000.0, "m")


class ObjectClustering(Behavior):
    """Robots gather objects by what one beam touches: nothing, an object or a robot.

    After M. Gauci et al., Clustering objects with robots that do not compute, AAMAS 2014. The pairs of wheel speeds, as
    shares of wheel_m_s, were not compared with the paper.
    """

    sees = Sight()
    metric = "object_cluster_fraction"
    wheel_m_s = 0.12
    settings = {"wheel_m_s": SPEED}
    left_nothing, right_nothing = 0.5, 1.0
    left_object, right_object = 1.0, 0.5
    left_robot, right_robot = 0.1, 0.5

    def step(self, sensed: Sensed, memory: Any, random: Random) -> Command:
        is_object, is_robot = sensed.sees == OBJECT, sensed.sees == ROBOT
        left = np.where(is_object, self.left_object, np.where(is_robot, self.left_robot, self.left_nothing))
        right = np.where(is_object, self.right_object, np.where(is_robot, self.right_robot, self.right_nothing))
        return (*join_wheels(self.wheel_m_s * left, self.wheel_m_s * right), memory)


class _Way(NamedTuple):
    """The way of the first object to the goal, as each robot sees it.

    Attributes:
        object_m: where the object is, forward and left (2, R).
        along: direction of its way, forward and left (2, R).
        length_m: of its way (R,).
        behind_m, aside_m: how far the robot is behind the object on this way, and how far to its right (R,).
    """

    object_m: np.ndarray
    along: np.ndarray
    length_m: np.ndarray
    behind_m: np.ndarray
    aside_m: np.ndarray


class PushToGoal(Behavior):
    """Base of behaviors that push the first object to a goal, a place in the common frame.

    Attributes:
        goal_radius_m: the object's center has arrived within it.
        gap_m: free space that robots keep from each other, and from the object on their way around it.
    """

    objects = Objects()
    near = Neighbors(range_m=0.25)
    metric = "object_distance"
    goal_x_m = goal_y_m = 0.0
    settings = {"goal_x_m": _COORDINATE, "goal_y_m": _COORDINATE, "linear_m_s": SPEED}
    goal_radius_m = 0.05
    linear_m_s = 0.08
    gap_m = 0.05

    def _find_way(self, sensed: Sensed) -> _Way:
        object_m = np.array((sensed.objects.forward_m[:, 0], sensed.objects.left_m[:, 0]))
        to_goal_m = self.goal_x_m - sensed.poses[:, 0], self.goal_y_m - sensed.poses[:, 1]
        way_m = turn(to_goal_m, -sensed.poses[:, 2]) - object_m
        length_m = np.maximum(np.hypot(*way_m), 1e-6)
        along = way_m / length_m
        behind_m = object_m[0] * along[0] + object_m[1] * along[1]
        return _Way(object_m, along, length_m, behind_m, along[0] * object_m[1] - along[1] * object_m[0])

    def _go_around(self, sensed: Sensed, way: _Way) -> np.ndarray:
        """Return the velocity (2, R) around the object, on the shorter side, until the robot is behind it."""
        range_m = np.maximum(np.hypot(*way.object_m), 1e-6)
        side = np.where(way.aside_m > 0.0, 1.0, -1.0)
        inward = np.clip(4.0 * (range_m - sensed.objects.radii_m[0] - BODY_RADIUS_M - self.gap_m), -1.0, 1.0)
        return self.linear_m_s * ((inward * way.object_m + side * _turn_left(way.object_m)) / range_m)

    def _command(self, sensed: Sensed, way: _Way, wanted: np.ndarray, gap_m: float) -> np.ndarray:
        """Return speeds (2, R) for a velocity that is wanted, away from robots nearer than gap_m; zero at the goal."""
        forward_m_s, left_m_s = wanted + keep_apart(sensed.near, 2.0 * BODY_RADIUS_M + gap_m, 2.0)
        moves = sensed.objects.seen[:, 0] & (way.length_m > self.goal_radius_m)
        return np.array(steer(forward_m_s, left_m_s, self.linear_m_s)) * moves


def _turn_left(vectors: np.ndarray) -> np.ndarray:
    return np.array((-vectors[1], vectors[0]))


class CooperativeTransport(PushToGoal):
    """Robots push an object where it hides the goal from them, and go around it until it does.

    J. Chen et al., Occlusion-based cooperative transport with a swarm of miniature mobile robots, IEEE T-RO 2015.

    Attributes:
        shade: half of the strip behind the object that counts as hidden, as a share of its radius.
    """

    shade = 0.6

    def step(self, sensed: Sensed, memory: Any, random: Random) -> Command:
        way = self._find_way(sensed)
        hidden = (way.behind_m > 0.0) & (np.abs(way.aside_m) < self.shade * sensed.objects.radii_m[0])
        share_m_s = self.linear_m_s / np.maximum(np.hypot(*way.object_m), 1e-6)
        wanted = np.where(hidden, share_m_s * way.object_m, self._go_around(sensed, way))
        return (*self._command(sensed, way, wanted, self.gap_m), memory)


class BoxPushing(PushToGoal):
    """Robots line up behind a box, side by side across its way to the goal, and push when all are in place.

    Side by side as the robots of M. Mataric et al., Cooperative multi-robot box-pushing, IROS 1995. The memory tells of
    each robot whether its world pushes.

    Attributes:
        spacing_m: between robots of the row.
        tolerance_m: a robot is in place so near to its own; one that is farther off ends the push.
    """

    spacing_m = 0.085
    tolerance_m = 0.03

    def step(self, sensed: Sensed, memory: Any, random: Random) -> Command:
        way = self._find_way(sensed)
        row_m = sensed.objects.radii_m[0] + BODY_RADIUS_M + self.gap_m
        # From right to left as they are now, so that no two paths cross.
        ranks = (-way.aside_m).reshape(-1, sensed.count).argsort(axis=1).argsort(axis=1).ravel()
        off_m = way.aside_m + (ranks - (sensed.count - 1) / 2.0) * self.spacing_m
        lag_m = way.behind_m - row_m
        ready = (np.abs(off_m) < self.tolerance_m) & (np.abs(lag_m) < self.tolerance_m)
        holds = (np.abs(off_m) < 3.0 * self.tolerance_m) & (way.behind_m > 0.0)
        pushes = self._agree(ready, sensed.count) | (
            memory & self._agree(holds, sensed.count) if memory is not None else False
        )
        # A robot that is not behind the object yet goes around it; from there it drives to its place, or on.
        arrived = way.behind_m > 0.5 * row_m
        ahead_m_s = np.where(pushes, self.linear_m_s, 1.5 * lag_m)
        to_place = ahead_m_s * way.along + 1.5 * off_m * _turn_left(way.along)
        wanted = np.where(arrived | pushes, to_place, self._go_around(sensed, way))
        return (*self._command(sensed, way, wanted, self.spacing_m - 2.0 * BODY_RADIUS_M), pushes)

    @staticmethod
    def _agree(values: np.ndarray, count: int) -> np.ndarray:
        """Return for each robot (R,) whether values hold for all of its world."""
        return np.repeat(values.reshape(-1, count).all(axis=1), count)
