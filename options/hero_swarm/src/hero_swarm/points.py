"""Points in place of robots, as in many papers: each moves at once as it is steered. Pure."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from hero_client.controllers import FAR_LOOKAHEAD_M
from hero_sim.world import World

from .behavior import turn


class PointRows:
    """The points of one or more worlds, as a trial steps them in place of RobotRows.

    Speeds are taken for those of the point that steer() moves, ahead of an axle: a point moves so, to any side, with
    the heading that it began with. It passes through others, stops at the arena's bounds, and sees nothing by infrared.

    Attributes:
        now_ms: how far all have been advanced.
        world: their poses, and what else a trial reads of a World, at rest.
    """

    def __init__(self, world: World) -> None:
        """Take the places of a world's robots."""
        poses = world.poses.copy("K")
        self.now_ms = world.time_ms
        others = {name: getattr(world, name) for name in ("errors", "object_poses", "arena")}
        self.world = SimpleNamespace(poses=poses, **others)
        self.proximity_m, self.counts = np.full((len(poses), 8), np.inf), np.zeros((len(poses), 8))
        self._ahead_m_s = self._left_m_s = np.zeros(len(poses))

    def send_velocity(self, rows: np.ndarray, linear_m_s: np.ndarray, angular_rad_s: np.ndarray) -> None:
        """Steer all points."""
        self._ahead_m_s, self._left_m_s = np.array(linear_m_s), FAR_LOOKAHEAD_M * np.array(angular_rad_s)

    def send_light(self, rows: np.ndarray, rgba: Any) -> None:
        """Show nothing: points have no lights."""

    def advance(self, until_ms: int) -> None:
        """Move all points on."""
        time_s, poses, arena = (until_ms - self.now_ms) / 1000.0, self.world.poses, self.world.arena
        poses[:, :2] += time_s * turn((self._ahead_m_s, self._left_m_s), poses[:, 2]).T
        np.clip(poses[:, :2], arena.bounds_m[:2], arena.bounds_m[2:], out=poses[:, :2])
        self.now_ms = until_ms
