"""Reciprocal collision avoidance (ORCA): velocities at which robots that know each other's poses do not collide.

Pure, numpy only. Each robot takes half of the change that keeps a pair apart for `horizon_s`; every other robot
gives a half plane of allowed velocities, and the robot takes the allowed one nearest to the one it wants.
Source: J. van den Berg, S. Guy, M. Lin, D. Manocha, Reciprocal n-body collision avoidance, ISRR 2009.

ORCA is made for discs that move any way at once. A robot with two wheels cannot move sideways, but a point lookahead_m
in front of its axle can: v = u . heading, w = u . left / lookahead_m. So the disc is put around that point and made
larger by lookahead_m, which covers the body whatever way it turns (J. Snape et al., Smooth and collision-free
navigation for multiple robots under differential-drive constraints, IROS 2010). ORCA was chosen over potential
fields and priorities because it is symmetric (same rule for all, no order among robots), local, and does not swing.
"""

import math
from typing import NamedTuple, Optional, Sequence, Tuple

import numpy as np

from hero_node import Pose, Velocity

from ..values.robot_constants import BODY_RADIUS_M

_TINY = 1e-9

_SLACK_HALVINGS = 12
"""Halvings of at most a few m/s: leaves less than a millimeter a second."""


class AvoidanceLaw(NamedTuple):
    """Settings of collision avoidance."""

    body_m: float = BODY_RADIUS_M
    lookahead_m: float = 0.03
    """The point that is steered lies this far in front of the axle; small: quick turns, large: wide berth."""
    margin_m: float = 0.012
    """Added to the radius for late and wrong odometry and for wheels that lag."""
    horizon_s: float = 3.0
    """Robots are kept apart for this time into the future."""
    neighbors: int = 6
    """Number of nearest robots that count: more do not fit around one."""
    max_linear_m_s: float = 0.08
    max_angular_rad_s: float = 2.5
    sense_m: float = 0.10
    """Obstacles that a proximity sensor sees nearer to the body than this count, whatever odometry says."""
    clearance_m: float = 0.03
    """So near to it the robot drives no further: as far as it rolls until a stop is measured, sent and obeyed."""
    closing_gain: float = 1.0
    """Largest speed towards it in m/s per meter that is left, 1/s."""
    back_off_m_s: float = 0.02
    """Largest speed away from what is nearer than clearance_m."""

    @property
    def radius_m(self) -> float:
        """Radius of the disc around the steered point."""
        return self.body_m + self.lookahead_m + self.margin_m

    @property
    def min_spacing_m(self) -> float:
        """Closer together robots do not reach their goals."""
        return 2.0 * self.radius_m + 0.02


def steered_point(pose: Pose, lookahead_m: float) -> np.ndarray:
    """Return the point (2,) lookahead_m in front of the robot's axle."""
    return np.array([pose.x_m + lookahead_m * math.cos(pose.yaw_rad), pose.y_m + lookahead_m * math.sin(pose.yaw_rad)])


def steer(pose: Pose, velocity: np.ndarray, law: AvoidanceLaw) -> Velocity:
    """Return the command that moves the steered point with velocity (2,), or slower the same way."""
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    linear_m_s = float(velocity[0] * cos + velocity[1] * sin)
    angular_rad_s = float(velocity[1] * cos - velocity[0] * sin) / law.lookahead_m
    excess = max(abs(linear_m_s) / law.max_linear_m_s, abs(angular_rad_s) / law.max_angular_rad_s, 1.0)
    return Velocity(linear_m_s / excess, angular_rad_s / excess)


def half_plane(
    offset: np.ndarray, velocity: np.ndarray, radius_m: float, horizon_s: float, step_s: float
) -> Tuple[np.ndarray, float]:
    """Return (normal, depth): own velocity changes c with c . normal >= depth keep a pair apart for horizon_s.

    offset: other minus own place (2,). velocity: own minus other velocity (2,). radius_m: sum of both radii.
    step_s: time in which discs that overlap already shall come apart. depth is for both robots together.
    """
    distance_m = float(np.hypot(*offset))
    if distance_m <= radius_m:
        # Overlap: leave it within one step.
        w = velocity - offset / step_s
        length = float(np.hypot(*w))
        normal = w / length if length > _TINY else np.array([-1.0, 0.0])
        return normal, radius_m / step_s - length
    # The forbidden velocities are a cone towards the other robot, cut off by a disc at offset / horizon_s.
    w = velocity - offset / horizon_s
    towards = float(w @ offset)
    length = float(np.hypot(*w))
    if towards < 0.0 and towards**2 > radius_m**2 * length**2:
        return w / length, radius_m / horizon_s - length
    leg = math.sqrt(distance_m**2 - radius_m**2)
    side = 1.0 if offset[0] * w[1] - offset[1] * w[0] > 0.0 else -1.0
    direction = (
        np.array([offset[0] * leg - side * offset[1] * radius_m, side * offset[0] * radius_m + offset[1] * leg])
        / distance_m**2
    )
    normal = side * np.array([-direction[1], direction[0]])
    return normal, -float(velocity @ normal)


def nearest_allowed(wanted: np.ndarray, normals: np.ndarray, bounds: np.ndarray, max_speed_m_s: float) -> np.ndarray:
    """Return the velocity nearest to wanted with normals @ v >= bounds and no faster than max_speed_m_s.

    Where there is none, all half planes are relaxed by the same, least amount. normals (N, 2), bounds (N,).
    """
    found = _best_corner(wanted, normals, bounds, max_speed_m_s)
    if found is not None:
        return found
    found = np.zeros(2)
    low_m_s, high_m_s = 0.0, float(np.max(bounds))  # stopping needs no more than the largest bound
    for _ in range(_SLACK_HALVINGS):
        slack_m_s = (low_m_s + high_m_s) / 2.0
        better = _best_corner(wanted, normals, bounds - slack_m_s, max_speed_m_s)
        if better is None:
            low_m_s = slack_m_s
        else:
            high_m_s, found = slack_m_s, better
    return found


def _best_corner(
    wanted: np.ndarray, normals: np.ndarray, bounds: np.ndarray, max_speed_m_s: float
) -> Optional[np.ndarray]:
    """Return the allowed velocity nearest to wanted, None if there is none.

    The nearest point of a convex set with straight edges and an arc is wanted itself, its foot on an edge, or a
    corner: there are few enough to try them all.
    """
    speed = float(np.hypot(*wanted))
    candidates = [wanted if speed <= max_speed_m_s else wanted * (max_speed_m_s / speed)]
    feet = wanted + (bounds - normals @ wanted)[:, None] * normals
    half_chords_m2 = max_speed_m_s**2 - bounds**2
    crossing = half_chords_m2 >= 0.0
    along = np.column_stack((-normals[:, 1], normals[:, 0]))
    middles = bounds[crossing, None] * normals[crossing]
    arms = np.sqrt(half_chords_m2[crossing])[:, None] * along[crossing]
    first, second = np.triu_indices(len(bounds), 1)
    cross = normals[first, 0] * normals[second, 1] - normals[first, 1] * normals[second, 0]
    meeting = np.abs(cross) > 1e-6
    first, second, cross = first[meeting], second[meeting], cross[meeting]
    corners = (
        np.column_stack(
            (
                bounds[first] * normals[second, 1] - bounds[second] * normals[first, 1],
                bounds[second] * normals[first, 0] - bounds[first] * normals[second, 0],
            )
        )
        / cross[:, None]
    )
    points = np.vstack((np.array(candidates), feet, middles + arms, middles - arms, corners))
    allowed = np.all(points @ normals.T >= bounds - _TINY, axis=1)
    allowed &= np.hypot(points[:, 0], points[:, 1]) <= max_speed_m_s + _TINY
    if not allowed.any():
        return None
    points = points[allowed]
    best: np.ndarray = points[np.argmin(np.sum((points - wanted) ** 2, axis=1))]
    return best


def avoid_sensed(
    pose: Pose, ranges: Sequence[float], wanted: np.ndarray, law: AvoidanceLaw
) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return wanted (2,) turned to the right of what the sensors see near, and half planes that keep away from it.

    Odometry drifts by centimeters over a meter or two, so robots that avoid each other by odometry alone touch now and
    then. Of two robots that meet where odometry expects none, each would wait for the other for ever: so what is
    not allowed of the wanted velocity is driven to the right, as on a road. Half planes: normals (K, 2), bounds (K,),
    as in nearest_allowed(). ranges: as in avoidance; nan (not known) gives none, so the caller warns of it.
    """
    normals, bounds = [], []
    for index, range_m in enumerate(ranges):
        gap_m = range_m - law.body_m
        if not gap_m < law.sense_m:
            continue
        angle_rad = pose.yaw_rad + index * 2.0 * math.pi / len(ranges)
        towards = np.array([math.cos(angle_rad), math.sin(angle_rad)])
        limit_m_s = max(law.closing_gain * (gap_m - law.clearance_m), -law.back_off_m_s)
        excess_m_s = float(wanted @ towards) - limit_m_s
        if excess_m_s > 0.0:
            right = np.array([towards[1], -towards[0]])
            forward_m_s = max(0.0, min(excess_m_s, excess_m_s + limit_m_s))
            wanted = wanted - excess_m_s * towards + forward_m_s * right
        normals.append(-towards)
        bounds.append(-limit_m_s)
    return wanted, np.array(normals).reshape(-1, 2), np.array(bounds)


def avoid_others(
    own: int,
    places: np.ndarray,
    velocities: np.ndarray,
    wanted: np.ndarray,
    law: AvoidanceLaw,
    step_s: float,
    normals: np.ndarray,
    bounds: np.ndarray,
) -> np.ndarray:
    """Return the velocity (2,) of the steered point of the robot at row own that is nearest to wanted (2,).

    places, velocities: of the steered points of all robots, each (N, 2), in one common frame. step_s: time between two
    calls. normals, bounds: more half planes of this robot, as avoid_sensed() gives them.
    """
    offsets = places - places[own]
    distances_m = np.hypot(offsets[:, 0], offsets[:, 1])
    reach_m = 2.0 * (law.radius_m + law.max_linear_m_s * law.horizon_s)
    near = [i for i in np.argsort(distances_m, kind="stable") if i != own and distances_m[i] < reach_m]
    near = near[: law.neighbors]
    changes = velocities[own] - velocities
    planes = [half_plane(offsets[i], changes[i], 2.0 * law.radius_m, law.horizon_s, step_s) for i in near]
    bounds = np.append([float(velocities[own] @ normal) + 0.5 * depth for normal, depth in planes], bounds)
    normals = np.vstack((*(normal for normal, _ in planes), normals))
    return nearest_allowed(wanted, normals, bounds, law.max_linear_m_s)
