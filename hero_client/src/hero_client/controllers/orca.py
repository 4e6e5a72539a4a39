"""Reciprocal collision avoidance (ORCA): velocities at which robots that know each other's poses do not collide.

Pure, numpy only. Each robot takes half of the change that keeps a pair apart for `horizon_s`; every other robot
gives a half plane of allowed velocities, and the robot takes the allowed one nearest to the one it wants.
Source: J. van den Berg, S. Guy, M. Lin, D. Manocha, Reciprocal n-body collision avoidance, ISRR 2009.

ORCA is made for discs that move any way at once; the disc is put around the point in front of the axle (half_planes),
which covers the body whatever way it turns (J. Snape et al., Smooth and collision-free navigation for multiple robots
under differential-drive constraints, IROS 2010).

Arrays: robots N, with rows of places, velocities (N, 2) and headings (N,).
"""

from typing import NamedTuple, Sequence, Tuple

import numpy as np

from hero_node.robot_constants import BODY_RADIUS_M

from .half_planes import LOOKAHEAD_M, MARGIN_M, NEIGHBORS

HalfPlanes = Tuple[np.ndarray, np.ndarray]
"""Normals (N, K, 2) and bounds (N, K) of each robot, as in half_planes.nearest_allowed()."""


class AvoidanceLaw(NamedTuple):
    """Settings of collision avoidance."""

    body_m: float = BODY_RADIUS_M
    lookahead_m: float = LOOKAHEAD_M
    margin_m: float = MARGIN_M
    horizon_s: float = 3.0
    """Robots are kept apart for this time into the future."""
    neighbors: int = NEIGHBORS
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


def keep_apart(
    offsets: np.ndarray, velocities: np.ndarray, radius_m: float, horizon_s: float, step_s: float
) -> HalfPlanes:
    """Return normals and depths: velocity changes c with c . normal >= depth keep pairs apart for horizon_s.

    offsets: other minus own places (..., 2). velocities: own minus other ones. radius_m: sum of both radii. step_s:
    time in which discs that overlap already shall come apart. depth is for both robots together.
    """
    x_m, y_m = offsets[..., 0], offsets[..., 1]
    distances_m = np.hypot(x_m, y_m)
    overlap = distances_m <= radius_m
    # The forbidden velocities are a cone towards the other robot, cut off by a disc at offset / time.
    times_s = np.where(overlap, step_s, horizon_s)
    off = velocities - offsets / times_s[..., None]
    speeds, towards = np.hypot(off[..., 0], off[..., 1]), (off * offsets).sum(axis=-1)
    at_disc = overlap | ((towards < 0.0) & (towards**2 > radius_m**2 * speeds**2))
    from_disc = np.where(speeds[..., None] > 1e-9, off / np.maximum(speeds, 1e-9)[..., None], (-1.0, 0.0))
    side = np.where(x_m * off[..., 1] > y_m * off[..., 0], 1.0, -1.0)
    leg_m = side * np.sqrt(np.maximum(distances_m**2 - radius_m**2, 0.0))
    # Across the leg of the cone on the side where the velocity lies.
    across = np.stack((-x_m * radius_m - leg_m * y_m, leg_m * x_m - y_m * radius_m), axis=-1)
    from_leg = across / np.maximum(distances_m**2, 1e-18)[..., None]
    normals = np.where(at_disc[..., None], from_disc, from_leg)
    return normals, np.where(at_disc, radius_m / times_s - speeds, -(velocities * normals).sum(axis=-1))


def avoid_others(places: np.ndarray, velocities: np.ndarray, law: AvoidanceLaw, step_s: float) -> HalfPlanes:
    """Return the half planes that keep each robot from the nearest others.

    places, velocities: of the steered points, in one common frame. step_s: time between two calls.
    """
    count = len(places)
    offsets = places - places[:, None]
    distances_m = np.hypot(offsets[..., 0], offsets[..., 1])
    distances_m[np.arange(count), np.arange(count)] = np.inf
    nearest = np.argsort(distances_m, axis=1, kind="stable")[:, : min(law.neighbors, count - 1)]
    rows = np.arange(count)[:, None]
    changes = velocities[:, None] - velocities[nearest]
    normals, depths = keep_apart(offsets[rows, nearest], changes, 2.0 * law.radius_m, law.horizon_s, step_s)
    bounds = (velocities[:, None] * normals).sum(axis=-1) + 0.5 * depths
    reach_m = 2.0 * (law.radius_m + law.max_linear_m_s * law.horizon_s)
    return normals, np.where(distances_m[rows, nearest] < reach_m, bounds, -np.inf)


def avoid_sensed(
    yaws_rad: np.ndarray, ranges: Sequence[Sequence[float]], wanted: np.ndarray, law: AvoidanceLaw
) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return wanted (N, 2) turned to the right of what the sensors see near, and half planes that keep away from it.

    Odometry drifts by centimeters over a meter or two, so robots that avoid each other by odometry alone touch now and
    then. Of two robots that meet where odometry expects none, each would wait for the other for ever: so what is
    not allowed of the wanted velocity is driven to the right, as on a road. ranges: of each robot as in avoidance, or
    none; nan (not known) gives no half plane, so the caller warns of it.
    """
    counts = np.array([max(1, len(seen)) for seen in ranges])
    gaps_m = np.full((len(ranges), counts.max()), np.inf)
    for row, seen in zip(gaps_m, ranges):
        row[: len(seen)] = np.asarray(seen) - law.body_m
    angles_rad = yaws_rad[:, None] + np.arange(gaps_m.shape[1]) * 2.0 * np.pi / counts[:, None]
    towards = np.stack((np.cos(angles_rad), np.sin(angles_rad)), axis=-1)
    near = gaps_m < law.sense_m
    limits_m_s = np.maximum(law.closing_gain * (np.where(near, gaps_m, 0.0) - law.clearance_m), -law.back_off_m_s)
    for beam in range(gaps_m.shape[1]):
        direction, limit_m_s = towards[:, beam], limits_m_s[:, beam]
        excess_m_s = np.where(near[:, beam], np.maximum((wanted * direction).sum(axis=1) - limit_m_s, 0.0), 0.0)
        forward_m_s = np.maximum(np.minimum(excess_m_s, excess_m_s + limit_m_s), 0.0)
        right = np.stack((direction[:, 1], -direction[:, 0]), axis=1)
        wanted = wanted - excess_m_s[:, None] * direction + forward_m_s[:, None] * right
    return wanted, -towards, np.where(near, -limits_m_s, -np.inf)
