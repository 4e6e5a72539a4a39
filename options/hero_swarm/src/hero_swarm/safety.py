"""Keeps robots apart and inside a fence, between a behavior and its commands: barrier functions on the steered point.

Pure: numpy only, over W worlds with N robots each. A point in front of the axle can move any way at once, so a
command is a velocity of this point; the nearest one is taken at which no two robots, and no robot and the fence,
close faster than their distance allows (L. Wang, A. Ames, M. Egerstedt, Safety barrier certificates for
collisions-free multirobot systems, IEEE T-RO 2017). Each of two robots takes half of the change, without asking the
other.
"""

from typing import Optional, Sequence, Tuple, Union

import numpy as np

from hero_client.controllers import LOOKAHEAD_M, MARGIN_M, NEIGHBORS, nearest_allowed
from hero_client.values import HERO, MAX_LINEAR_M_S, MAX_WHEEL_M_S, RobotModel

OFF, FENCE, ROBOTS = "off", "fence", "fence and robots"
MODES = (OFF, FENCE, ROBOTS)

RATE_HZ = 20.0
"""Calls per second by which the gains below keep robots apart; at 3 Hz they left the fence, at 1 Hz they touched."""

MAX_AGE_S = 0.5
"""A robot whose pose is older is stopped."""

TOLERANCE_M_S = 1e-3
"""Tolerance of closing speeds."""


class SafetyFilter:
    """Changes commands as little as safety allows; parameters may be set on an instance.

    Attributes:
        mode: off, fence, or fence and robots.
        lookahead_m: the steered point lies this far in front of the axle.
        margin_m: free space kept around each body.
        gain_1_s: closing speed allowed to two robots for each meter that is left.
        fence_gain_1_s: the same of a robot and the fence: half, as a fence does not give way to wheels that lag.
        neighbors: this many of the nearest robots are looked at: more do not fit around one.
        sidestep: share of what is taken from a velocity that goes to its right, so that robots that meet pass.
        max_speed_m_s, max_angular_rad_s, max_wheel_m_s: limits of the commands, and of what is wanted.
        radii_m: of the robots' bodies (N,), or one for all.
        others_m: x m, y m and body radius m of robots that are not commanded (M, 3), and so do not give way.
        is_limited: which robots were asked in the last call for more than they can drive, or for no number (W, N).
        calls, limited_calls: number of all calls, and of those in which a robot was limited.
    """

    lookahead_m = LOOKAHEAD_M
    margin_m = MARGIN_M
    gain_1_s = 4.0
    fence_gain_1_s = 2.0
    neighbors = NEIGHBORS
    sidestep = 3.0
    max_speed_m_s = MAX_LINEAR_M_S
    max_angular_rad_s = 6.0
    max_wheel_m_s = MAX_WHEEL_M_S

    def __init__(self, mode: str = ROBOTS, fence_m: Optional[np.ndarray] = None) -> None:
        """fence_m: x min, y min, x max, y max, which no body leaves.

        Raises: ValueError for another mode, and for a fence that is missing.
        """
        if mode not in MODES:
            raise ValueError(f"safety {mode!r}: must be one of {', '.join(MODES)}")
        if mode == FENCE and fence_m is None:
            raise ValueError(f"safety {mode} needs a fence: x min, y min, x max, y max in m")
        self.mode = mode
        self.radii_m: Union[float, Sequence[float]] = HERO.body_radius_m
        self._separations_m: Union[float, Sequence[float]] = HERO.wheel_separation_m
        self.others_m = np.empty((0, 3))
        self._fence_m = fence_m
        self.is_limited = np.zeros((1, 1), dtype=bool)
        self.calls = self.limited_calls = 0

    @property
    def rate_hz(self) -> float:
        """Least number of calls per second; 0 if nothing is filtered."""
        return 0.0 if self.mode == OFF else RATE_HZ

    def set_models(self, models: Sequence[RobotModel]) -> None:
        """Take bodies and wheels from the models of the robots (N,)."""
        self.radii_m = [model.body_radius_m for model in models]
        self._separations_m = [model.wheel_separation_m for model in models]

    def __call__(
        self, poses: np.ndarray, linear_m_s: np.ndarray, angular_rad_s: np.ndarray, ages_s: Optional[np.ndarray] = None
    ) -> Tuple[np.ndarray, np.ndarray]:
        """Return safe linear and angular speeds (W, N) for those wanted, at poses (W, N, 3) of now.

        Wanted ones are those of all robots of all worlds (W * N,), or one for all, as a behavior gives them. ages_s:
        of what poses were predicted from (W, N); see Control. A robot whose pose is NaN or too old is stopped, and
        others ignore it. Speeds that are no finite numbers stop their robot; those beyond the limits count as the
        fastest of the same curve.
        """
        linear_m_s, angular_rad_s = (
            np.broadcast_to(np.ravel(values), poses[..., 0].size).reshape(poses.shape[:2])
            for values in (linear_m_s, angular_rad_s)
        )
        are_numbers = np.isfinite(linear_m_s) & np.isfinite(angular_rad_s)
        linear_m_s, angular_rad_s = (np.where(are_numbers, values, 0.0) for values in (linear_m_s, angular_rad_s))
        if self.mode == OFF:
            return linear_m_s, angular_rad_s
        # First of all: the sweeps below do not converge from a velocity that is far from all that is allowed.
        share = self._find_share(linear_m_s, angular_rad_s)
        self.is_limited = (share < 1.0) | ~are_numbers
        self.calls += 1
        self.limited_calls += bool(self.is_limited.any())
        linear_m_s, angular_rad_s = linear_m_s * share, angular_rad_s * share
        ages_s = np.zeros(poses.shape[:2]) if ages_s is None else ages_s
        known = np.isfinite(poses).all(axis=2) & (ages_s <= MAX_AGE_S)
        yaw_rad = np.where(known, poses[..., 2], 0.0)
        places_m = np.where(known[..., None], poses[..., :2], 1e6)
        cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
        points_m = places_m + self.lookahead_m * np.stack((cosine, sine), axis=-1)
        aside_m_s = angular_rad_s * self.lookahead_m
        wanted = np.stack((cosine * linear_m_s - sine * aside_m_s, sine * linear_m_s + cosine * aside_m_s), axis=-1)
        normals, bounds = self._list_half_planes(points_m)
        # What is not allowed of a velocity is driven to the right, as on a road: robots that meet would wait forever.
        lacking = np.maximum(bounds - (normals * wanted[:, :, None]).sum(axis=-1), 0.0)
        right = np.stack((-normals[..., 1], normals[..., 0]), axis=-1)
        wanted = wanted + self.sidestep * (lacking[..., None] * right).sum(axis=2)
        rows = known.size  # not -1: a robot alone has no half planes
        found = nearest_allowed(
            wanted.reshape(rows, 2), normals.reshape(rows, *normals.shape[2:]), bounds.reshape(rows, bounds.shape[2]),
            self.max_speed_m_s,
        ).reshape(wanted.shape)  # fmt: skip
        # Between planes that face each other it has not converged: a slower velocity is within all bounds.
        closing_m_s, max_closing_m_s = -(normals * found[:, :, None]).sum(axis=-1), TOLERANCE_M_S - bounds
        is_too_fast = (closing_m_s > max_closing_m_s) & (bounds <= 0.0)
        slower = np.where(is_too_fast, max_closing_m_s / np.maximum(closing_m_s, TOLERANCE_M_S), 1.0)
        found = found * slower.min(axis=2, initial=1.0, keepdims=True)
        linear_m_s = (found[..., 0] * cosine + found[..., 1] * sine) * known
        angular_rad_s = (found[..., 1] * cosine - found[..., 0] * sine) / self.lookahead_m * known
        share = self._find_share(linear_m_s, angular_rad_s)
        return linear_m_s * share, angular_rad_s * share

    def _find_share(self, linear_m_s: np.ndarray, angular_rad_s: np.ndarray) -> np.ndarray:
        """Return the share of these speeds (W, N) that robots and their wheels can drive, at most 1."""
        linear_m_s, angular_rad_s = np.abs(linear_m_s), np.abs(angular_rad_s)
        # Each limit over the larger of itself and the speed: no speed is too large to be divided by.
        share = np.minimum(
            self.max_speed_m_s / np.maximum(linear_m_s, self.max_speed_m_s),
            self.max_angular_rad_s / np.maximum(angular_rad_s, self.max_angular_rad_s),
        )
        arms_m = np.broadcast_to(self._separations_m, linear_m_s.shape[1]) / 2.0
        wheels_m_s = share * linear_m_s + share * angular_rad_s * arms_m
        return share * self.max_wheel_m_s / np.maximum(wheels_m_s, self.max_wheel_m_s)

    def _list_half_planes(self, points_m: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return normals (W, N, K, 2) and bounds (W, N, K) for the steered points (W, N, 2)."""
        worlds, robots, _ = points_m.shape
        radii_m = np.broadcast_to(self.radii_m, robots) + self.lookahead_m + self.margin_m
        normals, bounds = [np.empty((worlds, robots, 0, 2))], [np.empty((worlds, robots, 0))]
        others = len(self.others_m)
        count = min(self.neighbors, robots - 1 + others)
        if self.mode == ROBOTS and count > 0:
            standing_m = np.broadcast_to(self.others_m[:, :2], (worlds, others, 2))
            away_m = points_m[:, :, None] - np.concatenate((points_m, standing_m), axis=1)[:, None]
            square_m2 = (away_m * away_m).sum(axis=-1)
            square_m2[:, np.arange(robots), np.arange(robots)] = np.inf
            nearest = np.sort(np.argpartition(square_m2, count - 1, axis=2)[..., :count])  # in one order everywhere
            away_m = np.take_along_axis(away_m, nearest[..., None], axis=2)
            distance_m = np.sqrt(np.maximum(np.take_along_axis(square_m2, nearest, axis=2), 1e-12))
            normals.append(away_m / distance_m[..., None])
            gaps_m = distance_m - radii_m[:, None] - np.append(radii_m, self.others_m[:, 2])[nearest]
            # Half of the closing speed that a pair may have, and all of it where the other one does not know.
            shares = np.repeat((0.5, 1.0), (robots, others))[nearest]
            bounds.append(-self.gain_1_s * shares * gaps_m)
        if self._fence_m is not None:
            gaps_m = np.concatenate((points_m - self._fence_m[:2], self._fence_m[2:] - points_m), axis=-1)
            gaps_m -= radii_m[:, None]
            inward = np.array([(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)])
            normals.append(np.broadcast_to(inward, (worlds, robots, 4, 2)))
            bounds.append(-self.fence_gain_1_s * gaps_m)
        return np.concatenate(normals, axis=2), np.concatenate(bounds, axis=2)
