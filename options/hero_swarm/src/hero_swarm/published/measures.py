"""Metrics of the published experiments that the suite's own do not have."""

from hero_swarm.metrics import cluster_fraction


def touching_fraction(state):
    """Return the share of robots in the largest cluster of centers less than 76 mm apart, as of SwarmAggregation."""
    return cluster_fraction(state.poses[..., :2], 0.076)
