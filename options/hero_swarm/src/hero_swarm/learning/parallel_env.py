"""The environment of PettingZoo (J. Terry et al., NeurIPS 2021) on simulated robots. Needs pettingzoo.

from hero_swarm.learning.parallel_env import SwarmEnv

env = SwarmEnv(robots=20, time_s=60.0)
observations, infos = env.reset(seed=1)
while env.agents:
    actions = {agent: env.action_space(agent).sample() for agent in env.agents}
    observations, rewards, terminations, truncations, infos = env.step(actions)
"""

from typing import Any, Dict, List, Optional, Tuple

import numpy as np
from gymnasium.spaces import Box
from pettingzoo import ParallelEnv

from hero_sim.world import build_default, load_arena

from .episode import Episode


class SwarmEnv(ParallelEnv):  # type: ignore[misc]
    """Each robot is an agent; all are truncated after time_s.

    An action is the share of the largest linear and angular speed, -1 to 1. Observations and rewards: see Episode.
    """

    metadata: Dict[str, Any] = {"name": "hero_swarm_v0", "render_modes": []}
    render_mode = None

    def __init__(
        self, robots: int = 20, arena: str = "", time_s: float = 60.0, neighbors: int = 5, **options: Any
    ) -> None:
        """arena: a name or file of the simulator; empty: a square that fits the robots. options: of Episode."""
        self.possible_agents = ["hero_%d" % number for number in range(robots)]
        self.agents: List[str] = []
        self._arena = load_arena(arena) if arena else build_default(robots)
        self._time_s = time_s
        self._options = {"neighbors": neighbors, **options}
        shape = Episode(robots, self._arena, 0, **self._options).observe().shape[1:]
        self._observed = {agent: Box(-1.0, 1.0, shape, np.float32) for agent in self.possible_agents}
        self._acts = {agent: Box(-1.0, 1.0, (2,), np.float32) for agent in self.possible_agents}
        self._seed = 0
        self._episode: Optional[Episode] = None

    def observation_space(self, agent: str) -> Box:
        """Return the space of observations, of each agent its own."""
        return self._observed[agent]

    def action_space(self, agent: str) -> Box:
        """Return the space of actions, of each agent its own."""
        return self._acts[agent]

    def reset(
        self, seed: Optional[int] = None, options: Optional[Dict[str, Any]] = None
    ) -> Tuple[Dict[str, np.ndarray], Dict[str, Dict[str, Any]]]:
        """Begin an episode of this seed; without one, of the seed after the last."""
        self._seed = self._seed + 1 if seed is None else seed
        self.agents = list(self.possible_agents)
        self._episode = Episode(len(self.agents), self._arena, self._seed, **self._options)
        return self._name(self._episode.observe()), {agent: {} for agent in self.agents}

    def step(self, actions: Dict[str, np.ndarray]) -> Tuple[Dict[str, Any], ...]:
        """Drive all robots for one period; return observations, rewards, terminations, truncations and infos."""
        assert self._episode is not None, "call reset() first"
        rewards = self._episode.step(np.array([actions[agent] for agent in self.agents]))
        ended = self._episode.time_s >= self._time_s - 1e-6
        results: Tuple[Dict[str, Any], ...] = (
            self._name(self._episode.observe()),
            self._name(rewards.tolist()),
            dict.fromkeys(self.agents, False),
            dict.fromkeys(self.agents, ended),
            {agent: {} for agent in self.agents},
        )
        if ended:
            self.agents = []
        return results

    def _name(self, values: Any) -> Dict[str, Any]:
        return dict(zip(self.agents, values))
