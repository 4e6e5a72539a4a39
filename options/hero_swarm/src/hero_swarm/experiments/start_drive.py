"""Drives robots to the places where a trial begins, around each other, and turns them there. Pure."""

from typing import List, Optional, Sequence

import numpy as np

from hero_client.controllers import AvoidanceLaw, SwarmGoToController, go_to_pose
from hero_client.values import BODY_RADIUS_M
from hero_node import STOP, Pose

PERIOD_S = 0.05
"""Time between two steps."""

_REST_STEPS = 10
"""Motors follow late: robots have arrived when all were there for this many steps."""


class StartDrive:
    """Robots on their way to their places.

    Attributes:
        done: all robots are in their places, and turned.
    """

    def __init__(self, places: np.ndarray, body_radius_m: float = BODY_RADIUS_M) -> None:
        """Begin; places: poses (N, 3), x m, y m, yaw rad. body_radius_m: of the widest robot."""
        self.done = False
        self._goals = [Pose(*place) for place in places.tolist()]
        law = AvoidanceLaw(body_m=body_radius_m)
        self._controller = SwarmGoToController([goal[:2] for goal in self._goals], law, PERIOD_S, seed=0)
        self._steps_at_rest = 0

    def step(
        self,
        poses: np.ndarray,
        ranges_m: Optional[Sequence[Sequence[float]]] = None,
        now_s: Optional[float] = None,
        ages_s: Optional[Sequence[float]] = None,
    ) -> np.ndarray:
        """Return the speeds of all robots, m/s and rad/s (2, N), at poses (N, 3): zero while a pose of any is NaN.

        ranges_m: what the proximity sensors of each robot see: it does not drive into what has no pose.
        now_s, ages_s: time and age of each pose, as in SwarmGoToController.step().
        """
        known: List[Optional[Pose]] = [Pose(*pose) if np.isfinite(pose).all() else None for pose in poses.tolist()]
        commands = self._controller.step(known, ranges_m, now_s, ages_s)
        for row, (pose, goal) in enumerate(zip(known, self._goals)):
            if self._controller.arrived[row] and None not in known:
                assert pose is not None
                commands[row] = go_to_pose(pose, goal, at_goal=True)
        at_rest = all(self._controller.arrived) and None not in known and set(commands) == {STOP}
        self._steps_at_rest = self._steps_at_rest + 1 if at_rest else 0
        self.done = self._steps_at_rest >= _REST_STEPS
        return np.array(commands).T
