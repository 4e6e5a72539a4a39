"""Drives robots as one rigid body, each with two wheels: pure, from poses and one command to a command for each.

A point ahead of each robot's axle follows its place in the body (feedback linearization: d'Andrea-Novel, Campion and
Bastin, 1995), so robots may begin with any headings. Places and velocities are complex numbers, x + y i.
"""

import cmath
from typing import List, Sequence

from hero_node import Pose, Velocity, clamp

AHEAD_M = 0.04
GAIN_1_S = 1.5
MAX_FORMATION_LINEAR_M_S, MAX_FORMATION_ANGULAR_RAD_S = 0.15, 2.5
PLACE_SPEED_M_S = 0.10
"""Speed of the fastest place, so that its robot can catch up."""

WAIT_FROM_M, WAIT_FULLY_M = 0.03, 0.12
"""By how far the last robot lags when the body slows down, and when it stops."""


class FormationDrive:
    """The body, which begins where the robots are.

    Attributes:
        pose: of the body: the middle of the robots, and their mean heading.
    """

    def __init__(self, poses: Sequence[Pose]) -> None:
        """Take the robots' poses in one frame."""
        points = [_find_point_ahead(pose) for pose in poses]
        middle = sum(points) / len(points)
        yaw_rad = cmath.phase(sum(cmath.rect(1.0, pose.yaw_rad) for pose in poses))
        self.pose = Pose(middle.real, middle.imag, yaw_rad)
        self._places = [(point - middle) * cmath.rect(1.0, -yaw_rad) for point in points]

    def step(self, poses: Sequence[Pose], command: Velocity, period_s: float) -> List[Velocity]:
        """Move the body by command for period_s, as far as the robots keep up; return a command for each robot."""
        middle, heading = complex(*self.pose[:2]), cmath.rect(1.0, self.pose.yaw_rad)
        targets = [middle + place * heading for place in self._places]
        points = [_find_point_ahead(pose) for pose in poses]
        lag_m = max(abs(target - point) for target, point in zip(targets, points))
        fastest_m_s = abs(command.linear_m_s) + abs(command.angular_rad_s) * max(map(abs, self._places))
        share = min(1.0, max(0.0, (WAIT_FULLY_M - lag_m) / (WAIT_FULLY_M - WAIT_FROM_M)))
        share *= min(1.0, PLACE_SPEED_M_S / fastest_m_s) if fastest_m_s > 0.0 else 0.0
        velocity, angular_rad_s = command.linear_m_s * share * heading, command.angular_rad_s * share
        commands = []
        for pose, target, point in zip(poses, targets, points):
            wanted = velocity + 1j * angular_rad_s * (target - middle) + GAIN_1_S * (target - point)
            wanted *= cmath.rect(1.0, -pose.yaw_rad)  # as seen from the robot
            robot_angular_rad_s = clamp(wanted.imag / AHEAD_M, MAX_FORMATION_ANGULAR_RAD_S)
            commands.append(Velocity(clamp(wanted.real, MAX_FORMATION_LINEAR_M_S), robot_angular_rad_s))
        middle += velocity * period_s
        self.pose = Pose(middle.real, middle.imag, self.pose.yaw_rad + angular_rad_s * period_s)
        return commands


def _find_point_ahead(pose: Pose) -> complex:
    return complex(pose.x_m, pose.y_m) + cmath.rect(AHEAD_M, pose.yaw_rad)
