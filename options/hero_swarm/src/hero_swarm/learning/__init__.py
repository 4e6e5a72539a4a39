"""Simulated robots as an environment for multi-agent reinforcement learning."""
