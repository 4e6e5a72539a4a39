"""Controllers of a robot with two wheels: pure functions from poses to a command, without clock, ROS or memory.

Poses and goals are in one common frame, m and rad (REP 103).
"""

import math
from typing import NamedTuple

from hero_node import STOP, Pose, Velocity, clamp, measure_distance, wrap_angle


class GoToLaw(NamedTuple):
    """Gains and limits of going to a place: as quickly as motors (0.5 s to a new speed) follow without swinging."""

    linear_gain: float = 0.8
    """Speed in m/s per meter of distance, 1/s."""
    turn_gain: float = 1.5
    """Turn in rad/s per radian of bearing, and of heading at the place, 1/s."""
    max_linear_m_s: float = 0.12
    max_angular_rad_s: float = 1.5
    tolerance_m: float = 0.01
    """Nearer than this the robot has arrived."""


GO_TO = GoToLaw()


def go_to_point(pose: Pose, x_m: float, y_m: float, law: GoToLaw = GO_TO) -> Velocity:
    """Return the command that drives a robot at pose towards the point; STOP where it has arrived.

    Unicycle law: v = kr * distance * cos(a), w = ka * a with a the angle from the heading to the goal. A goal behind
    is approached backwards (a is then measured from the back). pose and point are in the same frame.
    """
    distance_m = math.hypot(x_m - pose.x_m, y_m - pose.y_m)
    if distance_m < law.tolerance_m:
        return STOP
    off_rad = wrap_angle(math.atan2(y_m - pose.y_m, x_m - pose.x_m) - pose.yaw_rad)
    linear_m_s = clamp(law.linear_gain * distance_m * math.cos(off_rad), law.max_linear_m_s)
    if abs(off_rad) > math.pi / 2.0:
        off_rad = wrap_angle(off_rad + math.pi)
    return Velocity(linear_m_s, clamp(law.turn_gain * off_rad, law.max_angular_rad_s))


K1 = 1.0
"""Larger: the robot bends earlier towards the final heading."""

K2 = 2.0
"""Rate of convergence onto that curve, relative to the speed."""

SLOWING_M2 = 0.003
"""beta: how much it slows down in curves: to half where the curve has a radius of sqrt(beta)."""

DOCKING_M = 0.03
"""Nearer than this straight to the place: the curve would be too tight for motors that lag 0.5 s."""

TOLERANCE_RAD = 0.05


def go_to_pose(pose: Pose, goal: Pose, law: GoToLaw = GO_TO, at_goal: bool = False) -> Velocity:
    """Return the command of a smooth curve to goal that ends in its heading; STOP where it is reached.

    at_goal: the place was reached already; only the heading counts, so that a millimeter of drift during the last
    turn does not start a new approach. pose and goal are in the same frame.
    Source: J. J. Park, B. Kuipers, A smooth control law for graceful motion of differential wheeled mobile robots
    in 2D environment, ICRA 2011, equations 13 to 15.
    """
    distance_m = measure_distance(pose, goal)
    if at_goal or distance_m < law.tolerance_m:
        off_rad = wrap_angle(goal.yaw_rad - pose.yaw_rad)
        if abs(off_rad) < TOLERANCE_RAD:
            return STOP
        return Velocity(0.0, clamp(law.turn_gain * off_rad, law.max_angular_rad_s))
    if distance_m < DOCKING_M:
        return go_to_point(pose, goal.x_m, goal.y_m, law)
    sight_rad = math.atan2(goal.y_m - pose.y_m, goal.x_m - pose.x_m)
    goal_off_rad = wrap_angle(goal.yaw_rad - sight_rad)  # theta of the paper
    own_off_rad = wrap_angle(pose.yaw_rad - sight_rad)  # delta of the paper
    pull = K2 * (own_off_rad - math.atan(-K1 * goal_off_rad))
    pull += (1.0 + K1 / (1.0 + (K1 * goal_off_rad) ** 2)) * math.sin(own_off_rad)
    curvature_1_m = -pull / distance_m
    linear_m_s = law.max_linear_m_s / (1.0 + SLOWING_M2 * curvature_1_m**2)
    linear_m_s = min(linear_m_s, law.linear_gain * distance_m)
    angular_rad_s = curvature_1_m * linear_m_s
    if abs(angular_rad_s) > law.max_angular_rad_s:  # the curve stays the same, only slower
        linear_m_s *= law.max_angular_rad_s / abs(angular_rad_s)
        angular_rad_s = math.copysign(law.max_angular_rad_s, angular_rad_s)
    return Velocity(linear_m_s, angular_rad_s)


class FollowLaw(NamedTuple):
    """Gains and limits of following another robot."""

    gap_m: float = 0.15
    """Distance between the centers; two bodies touch at 0.074 m."""
    linear_gain: float = 1.0
    turn_gain: float = 2.0
    max_linear_m_s: float = 0.15
    max_angular_rad_s: float = 2.0


FOLLOW = FollowLaw()


def follow(pose: Pose, leader: Pose, law: FollowLaw = FOLLOW) -> Velocity:
    """Return the command that keeps a robot at pose one gap away from leader and turned towards it.

    It never drives backwards: a leader that comes nearer is waited for. pose and leader are in the same frame.
    """
    distance_m = measure_distance(pose, leader)
    off_rad = wrap_angle(math.atan2(leader.y_m - pose.y_m, leader.x_m - pose.x_m) - pose.yaw_rad)
    linear_m_s = max(0.0, law.linear_gain * (distance_m - law.gap_m)) * max(0.0, math.cos(off_rad))
    return Velocity(min(law.max_linear_m_s, linear_m_s), clamp(law.turn_gain * off_rad, law.max_angular_rad_s))
