"""Learns to gather by the cross-entropy method on plain arrays, and saves a policy that is a behavior.

python3 learn_gathering.py gathering_policy.npz
"""

import sys

import numpy as np

from hero_swarm.learning.policy import run_network, save_policy
from hero_swarm.learning.vector_env import SwarmVectorEnv

CANDIDATES, ELITE, GENERATIONS = 32, 8, 30
INPUTS = 14 + 2 * 3


def split(numbers):
    """Return the one layer of a policy: weights and biases."""
    weights = numbers.reshape(INPUTS + 1, 2)
    return [(weights[:-1], weights[-1])]


def main(path):
    """Learn in worlds of one candidate each, and write the mean of the best ones."""
    env = SwarmVectorEnv(CANDIDATES, 8, "empty", 20.0, neighbors=3, range_m=1.0, metric="dispersion_ratio")
    random = np.random.RandomState(1)
    mean, spread = np.zeros(2 * (INPUTS + 1)), np.full(2 * (INPUTS + 1), 0.5)
    for generation in range(GENERATIONS):
        candidates = mean + spread * random.standard_normal((CANDIDATES, len(mean)))
        observed, gained = env.reset(1000 + CANDIDATES * generation), 0.0
        while not env.ended:
            worlds = observed.reshape(CANDIDATES, env.robots, INPUTS)
            actions = np.concatenate([run_network(split(own), seen) for own, seen in zip(candidates, worlds)])
            observed, rewards = env.step(actions)
            gained = gained + rewards.reshape(CANDIDATES, env.robots)[:, 0]
        best = candidates[np.argsort(-gained)[:ELITE]]
        mean, spread = best.mean(axis=0), best.std(axis=0) + 0.02
        print("generation %d: %.2f" % (generation + 1, np.median(gained)), flush=True)
    save_policy(path, split(mean), env.observation)


if __name__ == "__main__":
    main(*sys.argv[1:])
