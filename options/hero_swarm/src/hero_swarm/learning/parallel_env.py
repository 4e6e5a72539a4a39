"""The environment of PettingZoo (J. Terry et al., NeurIPS 2021) on simulated robots. Needs pettingzoo."""

from typing import Any, Dict, List, Optional, Tuple

import numpy as np
from gymnasium.spaces import Box
from pettingzoo import ParallelEnv

from .vector_env import SwarmVectorEnv


class SwarmEnv(ParallelEnv):  # type: ignore[misc]
    """One world of SwarmVectorEnv, in which each robot is an agent; all are truncated after time_s."""

    metadata: Dict[str, Any] = {"name": "hero_swarm_v0", "render_modes": []}
    render_mode = None

    def __init__(self, robots: int = 20, arena: str = "", time_s: float = 60.0, **options: Any) -> None:
        """options: of SwarmVectorEnv."""
        self.possible_agents = ["hero_%d" % number for number in range(robots)]
        self.agents: List[str] = []
        self._env = SwarmVectorEnv(1, robots, arena, time_s, **options)
        shape = self._env.reset(seed=0).shape[1:]
        self._observed = {agent: Box(-1.0, 1.0, shape, np.float32) for agent in self.possible_agents}
        self._acts = {agent: Box(-1.0, 1.0, (2,), np.float32) for agent in self.possible_agents}

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
        self.agents = list(self.possible_agents)
        return self._name(self._env.reset(seed)), {agent: {} for agent in self.agents}

    def step(self, actions: Dict[str, np.ndarray]) -> Tuple[Dict[str, Any], ...]:
        """Drive all robots for one period; return observations, rewards, terminations, truncations and infos."""
        observed, rewards = self._env.step(np.array([actions[agent] for agent in self.agents]))
        results: Tuple[Dict[str, Any], ...] = (
            self._name(observed),
            self._name(rewards.tolist()),
            dict.fromkeys(self.agents, False),
            dict.fromkeys(self.agents, self._env.ended),
            {agent: {} for agent in self.agents},
        )
        if self._env.ended:
            self.agents = []
        return results

    def _name(self, values: Any) -> Dict[str, Any]:
        return dict(zip(self.agents, values))
