"""Many worlds at once as one environment of plain arrays, for policies that all robots share. Pure: numpy only.

env = SwarmVectorEnv(worlds=32, robots=10, time_s=30.0)
observed = env.reset(seed=1)                   # (320, K)
while not env.ended:
    observed, rewards = env.step(np.zeros((320, 2)))
"""

from typing import Any, Optional, Tuple

import numpy as np

from hero_sim.world import build_default, load_arena

from .episode import Episode


class SwarmVectorEnv:
    """W worlds with N robots each, the rows of all arrays, world after world; all end after time_s.

    Actions (R, 2) are shares of the largest linear and angular speed, -1 to 1. Observations and rewards: see Episode.

    Attributes:
        ended: whether the time is over: call reset().
        episode: the present one; its observation is needed to save a policy.
    """

    episode: Episode

    def __init__(
        self, worlds: int = 16, robots: int = 10, arena: str = "", time_s: float = 60.0, **options: Any
    ) -> None:
        """arena: a name or file of the simulator; empty: a square that fits the robots. options: of Episode."""
        self.worlds, self.robots = worlds, robots
        self._arena = load_arena(arena) if arena else build_default(robots)
        self._time_s, self._options = time_s, options
        self._seed = 0
        self.ended = True

    def reset(self, seed: Optional[int] = None) -> np.ndarray:
        """Begin worlds of this seed and those after it, without one of the next seeds; return observations (R, K)."""
        first = self._seed if seed is None else seed
        self._seed, self.ended = first + self.worlds, False
        self.episode = Episode(self.robots, self._arena, range(first, self._seed), **self._options)
        return self.episode.observe()

    def step(self, actions: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Drive all robots for one period; return observations (R, K) and rewards (R,)."""
        rewards = self.episode.step(actions)
        self.ended = self.episode.time_s >= self._time_s - 1e-6
        return self.episode.observe(), rewards
