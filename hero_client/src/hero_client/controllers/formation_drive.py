"""Drives robots as one rigid body, each with two wheels: pure, from poses and one command to a command for each.

A point ahead of each robot's axle follows its place in the body (feedback linearization: d'Andrea-Novel, Campion and
Bastin, 1995), so robots may begin with any headings.
"""

import math
from typing import List, Sequence, Tuple

from hero_node.geometry import Pose, Velocity, clamp

AHEAD_M = 0.04
GAIN_1_S = 1.5
MAX_LINEAR_M_S, MAX_ANGULAR_RAD_S = 0.15, 2.5
PLACE_SPEED_M_S = 0.10
"""Of the fastest place, so that its robot can catch up."""

WAIT_FROM_M, WAIT_FULLY_M = 0.03, 0.12
"""By how far the last robot lags when the body slows down, and when it stops."""


class FormationDrive:
    """The body, which begins where the robots are.

    Attributes:
        pose: of the body: the middle of the robots, and their mean heading.
    """

    def __init__(self, poses: Sequence[Pose]) -> None:
        """Take the robots' poses in one frame."""
        sin, cos = (sum(turn(pose.yaw_rad) for pose in poses) for turn in (math.sin, math.cos))
        heading_rad = math.atan2(sin, cos)
        points = [_find_point_ahead(pose) for pose in poses]
        x_m, y_m = (sum(values) / len(points) for values in zip(*points))
        self.pose = Pose(x_m, y_m, heading_rad)
        self._places_m = [_rotate(x - x_m, y - y_m, -heading_rad) for x, y in points]

    def step(self, poses: Sequence[Pose], command: Velocity, period_s: float) -> List[Velocity]:
        """Move the body by command for period_s, as far as the robots keep up; return a command for each robot."""
        targets = [self._find_place(index) for index in range(len(poses))]
        points = [_find_point_ahead(pose) for pose in poses]
        lag_m = max(math.dist(target, point) for target, point in zip(targets, points))
        radius_m = max(math.hypot(*place) for place in self._places_m)
        fastest_m_s = abs(command.linear_m_s) + abs(command.angular_rad_s) * radius_m
        share = min(1.0, max(0.0, (WAIT_FULLY_M - lag_m) / (WAIT_FULLY_M - WAIT_FROM_M)))
        share *= min(1.0, PLACE_SPEED_M_S / fastest_m_s) if fastest_m_s > 0.0 else 0.0
        linear_m_s, angular_rad_s = command.linear_m_s * share, command.angular_rad_s * share
        forward_x, forward_y = _rotate(linear_m_s, 0.0, self.pose.yaw_rad)
        commands = []
        for pose, (x_m, y_m), (at_x_m, at_y_m) in zip(poses, targets, points):
            along_m_s, across_m_s = _rotate(
                forward_x - angular_rad_s * (y_m - self.pose.y_m) + GAIN_1_S * (x_m - at_x_m),
                forward_y + angular_rad_s * (x_m - self.pose.x_m) + GAIN_1_S * (y_m - at_y_m),
                -pose.yaw_rad,
            )
            robot_angular_rad_s = clamp(across_m_s / AHEAD_M, MAX_ANGULAR_RAD_S)
            commands.append(Velocity(clamp(along_m_s, MAX_LINEAR_M_S), robot_angular_rad_s))
        self.pose = Pose(
            self.pose.x_m + forward_x * period_s,
            self.pose.y_m + forward_y * period_s,
            self.pose.yaw_rad + angular_rad_s * period_s,
        )
        return commands

    def _find_place(self, index: int) -> Tuple[float, float]:
        x_m, y_m = _rotate(*self._places_m[index], self.pose.yaw_rad)
        return self.pose.x_m + x_m, self.pose.y_m + y_m


def _find_point_ahead(pose: Pose) -> Tuple[float, float]:
    return pose.x_m + AHEAD_M * math.cos(pose.yaw_rad), pose.y_m + AHEAD_M * math.sin(pose.yaw_rad)


def _rotate(x: float, y: float, angle_rad: float) -> Tuple[float, float]:
    sin, cos = math.sin(angle_rad), math.cos(angle_rad)
    return x * cos - y * sin, x * sin + y * cos
